"""The BMUs of one CAN bus and the thread that reads them; it opens the bus, and reopens it after a failure."""

import logging
import threading
from collections.abc import Callable, Sequence
from functools import partial
from math import ceil, floor
from typing import Protocol

from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.errors import LinkError
from orchestrator.model import Cause
from orchestrator.protocol.sdo import NMT_COB_ID

#: Frames that one turn may send, however late it is: SocketCAN's transmit queue takes 10.
MOST_AT_ONCE = 8
REOPEN_S = 1.0  #: pause before a failed bus is reopened
IDLE_S = 0.1  #: longest wait for a frame, and so until `close()` is noticed
CLOSE_S = 3.0  #: slcan sleeps 2 s when it opens
STALL_S = 0.5  #: without a turn for this long the loop hangs; five ticks


class CanPort(Protocol):
    """The interface of `link/can.py` used here."""

    name: str
    trouble: Cause | None

    def subscribe(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None:
        """Receive the frames with this id, except our own."""

    def open(self) -> None:
        """LinkError if that fails."""

    def close(self) -> None:
        """Never raises."""

    def receive(self, timeout_s: float, pause_s: float = 0.0) -> None:
        """Dispatch the frames that arrive, waiting up to `timeout_s` for one; LinkError if the bus is broken.

        For the first `pause_s` nobody waits for a frame: what arrives in that time may be taken together.
        """

    def send(self, cob_id: int, data: bytes) -> None:
        """LinkError if the bus is broken, RefusedError for a frame that may not be sent."""


class BatteryBus:
    """One bus with its BMUs. `clock` gives monotonic seconds."""

    def __init__(
        self, port: CanPort, nodes: Sequence[BatteryNode], budget: BusBudget, clock: Callable[[], float]
    ) -> None:
        self._port = port
        self._budget = budget  # the one that the nodes share
        self._nodes = tuple(nodes)
        self._clock = clock
        self._closing = threading.Event()
        self._open = False
        self._trouble: Cause | None = None
        self._busy = False  # something was sent or received: more will follow soon
        self._sent = 0  # frames, in this turn
        self._turn_s = clock()
        self._thread = threading.Thread(target=self._run, name=f"can-{port.name}", daemon=True)
        for node in self._nodes:
            for cob_id in node.cob_ids:
                port.subscribe(cob_id, partial(self._on_frame, node))
        port.subscribe(NMT_COB_ID, self._on_nmt)

    def start(self) -> None:
        """Begin to read. A failure to open the bus is shown in every node's link, not raised."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and close the bus.

        A hung driver (slcan opens a stalled adapter for ever) is abandoned after CLOSE_S.
        """
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(CLOSE_S)

    def stalled(self, now_s: float) -> bool:
        """True if the loop hangs or has ended. While the bus is closed, with all nodes offline, it may take longer."""
        return not self._closing.is_set() and (
            not self._thread.is_alive() or (self._open and now_s - self._turn_s > STALL_S)
        )

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                self._port.open()
                self._open, self._turn_s = True, self._clock()
                while not self._closing.is_set():
                    self._turn()
            except LinkError as error:
                self._failed(error.cause)
            except Exception as error:  # noqa: BLE001 - the thread must survive, and the reason be seen
                self._failed(Cause.of("can_internal", bus=self._port.name, error=repr(error)))
            self._open = False
            self._port.close()
            self._closing.wait(REOPEN_S)

    def _turn(self) -> None:
        now_s = self._turn_s = self._clock()
        due_s = self._take_turns(now_s)
        # Waits end at ticks only: what is due between two ticks waits for the later one.
        each_s = self._budget.tick_s
        tick_s = floor(now_s / each_s + 1.0) * each_s
        wait_s = (tick_s if due_s <= tick_s else ceil(due_s / each_s) * each_s) - now_s
        pause_s, self._busy = (tick_s - now_s if self._busy else 0.0), False
        self._port.receive(wait_s, pause_s)
        if self._port.trouble != self._trouble:
            self._trouble = self._port.trouble
            for node in self._nodes:
                node.trouble = self._trouble

    def _take_turns(self, now_s: float) -> float:
        """Let the nodes do what is due, and return when the next of them is due."""
        due_s, self._sent = now_s + IDLE_S, 0
        for number, node in enumerate(self._nodes):
            if node.next_due_s <= now_s:
                if self._sent >= MOST_AT_ONCE:
                    self._nodes = self._nodes[number:] + self._nodes[:number]  # the rest come first in the next turn
                    return now_s
                try:
                    node.turn(now_s, self._send)
                except LinkError:
                    raise
                except Exception as error:  # noqa: BLE001 - one node's fault must not take down the others' bus
                    self._node_failed(node, error)
            if node.next_due_s < due_s:  # twice as fast as min(), and this is the innermost loop
                due_s = node.next_due_s
        return due_s

    def _send(self, cob_id: int, data: bytes) -> None:
        self._sent += 1
        self._busy = True
        self._port.send(cob_id, data)

    def _on_frame(self, node: BatteryNode, cob_id: int, data: bytes) -> None:
        self._busy = True
        try:
            node.on_frame(cob_id, data, self._clock())
        except Exception as error:  # noqa: BLE001 - as above
            self._node_failed(node, error)

    def _on_nmt(self, _cob_id: int, data: bytes) -> None:
        for node in self._nodes:
            try:
                node.on_nmt(data, self._clock())
            except Exception as error:  # noqa: BLE001 - as above
                self._node_failed(node, error)

    def _node_failed(self, node: BatteryNode, error: Exception) -> None:
        self._show(node, Cause.of("bmu_internal", node_id=node.node_id, bus=self._port.name, error=repr(error)))

    def _failed(self, problem: Cause) -> None:
        for node in self._nodes:
            self._show(node, problem)

    def _show(self, node: BatteryNode, problem: Cause) -> None:
        try:
            node.fail(problem, self._clock())
        except Exception:  # the view has it already; only notifying others has failed as well
            logging.getLogger(__name__).exception("%s", problem)
