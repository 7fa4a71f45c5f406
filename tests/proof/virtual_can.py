"""A CAN bus in memory, as a python-can driver below the unchanged `link/can.py`, in virtual time.

The controller's side is `Driver`, the emulated nodes' side is `BusWire`. A frame takes time on the wire, and frames
follow each other. Every driver call goes through `Calls`, which can make any of them fail.
"""

from collections import deque
from collections.abc import Callable

import can

from orchestrator.sim.can_noise import Bus, BusNoise
from orchestrator.sim.can_wire import PERFECT
from orchestrator.sim.timers import Handler
from tests.proof.virtual_calls import Calls
from tests.proof.virtual_threads import Waiting
from tests.proof.virtual_time import Time

#: One frame of 8 bytes at 250 kbit/s, stuff bits and pause included.
FRAME_S = 0.0005


class BusWire:
    """The wire and the emulated nodes on it; the counterpart of `sim.can_wire.CanWire`."""

    def __init__(self, time: Time, calls: Calls, kind: Bus = PERFECT) -> None:
        self.calls = calls
        self.down = False  #: the interface is down: every call fails with ENETDOWN, and open sockets stay deaf
        self.lost = False  #: nobody hears anybody
        self.epoch = 0  #: how often the interface went down
        self.on_frame: Callable[[int, bytes], None] = lambda _cob_id, _data: None  #: frames of nodes that were received
        self.drivers: list[Driver] = []
        self._time = time
        self._free_s = 0.0
        self._subscribers: dict[int, dict[object, Handler]] = {}
        self._remote: dict[int, dict[object, Handler]] = {}
        self._noise = BusNoise(kind)

    def subscribe(self, cob_id: int, owner: object, handler: Handler) -> None:
        self._subscribers.setdefault(cob_id, {})[owner] = handler

    def unsubscribe(self, cob_id: int, owner: object) -> None:
        self._subscribers.get(cob_id, {}).pop(owner, None)

    def subscribe_remote(self, cob_id: int, owner: object, handler: Handler) -> None:
        self._remote.setdefault(cob_id, {})[owner] = handler

    def send(self, cob_id: int, data: bytes) -> None:
        """A node or another master sends: everybody receives it."""
        self._put(self._to_all, can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def raw(self, message: can.Message) -> None:
        """A frame of a kind the emulated nodes do not receive."""
        self._time.call_at(self._slot(), self._to_drivers, message)

    def _to_drivers(self, message: can.Message) -> None:
        for driver in () if self.down or self.lost else self.drivers:
            driver.deliver(message)

    def send_remote(self, cob_id: int) -> None:
        self._put(self._to_all, can.Message(arbitration_id=cob_id, is_remote_frame=True, is_extended_id=False))

    def from_driver(self, cob_id: int, data: bytes, sender: "Driver") -> None:
        message = can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)
        self._put(lambda heard: self._to_nodes(heard, sender), message)

    def _put(self, hear: Callable[[can.Message], None], whole: can.Message) -> None:
        at_s = self._slot()
        message = self._noise.spoil(whole)
        if message is not None:
            self._time.call_at(at_s, hear, message)

    def _slot(self) -> float:
        self._free_s = max(self._free_s, self._time.now_s) + FRAME_S
        return self._free_s

    def _to_all(self, message: can.Message) -> None:
        if not (self.down or self.lost):
            if self.drivers and not message.is_error_frame and not message.is_remote_frame:
                self.on_frame(message.arbitration_id, bytes(message.data))
            self.drivers = [
                driver for driver in self.drivers if driver.process is None or driver.process.status is None
            ]
            self._to_nodes(message, None)

    def _to_nodes(self, message: can.Message, sender: "Driver | None") -> None:
        if self.down or self.lost:
            return
        for driver in self.drivers:
            if driver is not sender and (sender is None or not message.is_error_frame):
                driver.deliver(message)
        if not message.is_error_frame:
            handlers = (self._remote if message.is_remote_frame else self._subscribers).get(message.arbitration_id, {})
            for handler in tuple(handlers.values()):
                handler(message.arbitration_id, bytes(message.data))

    def go_down(self) -> None:
        self.down = True
        self.epoch += 1
        for driver in self.drivers:
            driver.news.wake()


class Driver(can.BusABC):
    """The driver python-can would open."""

    def __init__(self, wire: BusWire, time: Time) -> None:
        self.calls = wire.calls
        self.calls("can open")
        if wire.down:
            raise OSError(100, "Network is down")
        self._wire, self._time, self._epoch = wire, time, wire.epoch
        self._heard: deque[can.Message] = deque()
        self.process = time.me().process  #: the owning process; once it is dead, nothing is received
        self.news = Waiting(time)
        super().__init__(channel="virtual time")
        wire.drivers.append(self)

    def deliver(self, message: can.Message) -> None:
        if self._epoch == self._wire.epoch:
            self._heard.append(message)
            self.news.wake()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        told = self.calls("can recv")
        if told is not None:
            self._time.wait(self._time.now_s + FRAME_S)
            return told  # type: ignore[no-any-return]  # a message
        if not self._heard and not self._wire.down:
            self.news.wait(timeout)
        if self._wire.down:
            raise can.CanOperationError("Error receiving: Network is down", 100)
        return self._heard.popleft() if self._heard else None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.calls("can send")
        if self._wire.down:
            raise can.CanOperationError("Failed to transmit: Network is down", 100)
        self._wire.from_driver(msg.arbitration_id, bytes(msg.data), self)

    def shutdown(self) -> None:
        super().shutdown()
        if self in self._wire.drivers:
            self._wire.drivers.remove(self)
            self.calls("can shutdown")
