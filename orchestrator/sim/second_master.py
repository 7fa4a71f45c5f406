"""A second CANopen master on the bus: a service tool that reads, writes and commands a node (CiA 301, §7.2.4, §7.2.8).

Written from the document, not from our own client: it reads in segments and in blocks, and sends requests without
waiting for earlier answers, as tools that display many values do. On a `CanWire` it needs an interface that echoes
frames to their sender (`udp_multicast`, or `receive_own_messages`), or its own wire.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle

from orchestrator.sim.timers import Timer, Timers, Wire

Key = tuple[int, int]  #: index and sub-index

#: All measurement objects of the BMU, its heartbeat, its name (longer than 4 bytes) and its identity.
EVERYTHING: tuple[Key, ...] = (
    (0x6000, 0), (0x6001, 0), (0x6002, 0), (0x6003, 0), (0x6004, 0), (0x1017, 0), (0x1008, 0), (0x1018, 1),
)  # fmt: skip
PERIOD_S = 0.01
BLOCK = 127  #: segments in a block, the maximum
GUARD, LSS_MASTER = 0x700, 0x7E5


@dataclass(slots=True)
class Seen:
    """Counts of requests and results."""

    asked: int = 0  #: requests of all kinds, segments not counted
    values: int = 0
    texts: int = 0  #: completed longer transfers
    written: int = 0
    aborts: int = 0


class SecondMaster:
    """Queries one node. Belongs to the thread of its clock."""

    def __init__(self, timers: Timers, wire: Wire, node_id: int) -> None:
        self.seen = Seen()
        self.node_id = node_id
        self._timers, self._wire = timers, wire
        self._timer: Timer | None = None
        self._toggle = 0
        self._block = False  # a block is being read
        self._segments = 0
        wire.subscribe(0x580 + node_id, self, self._hear)

    def close(self) -> None:
        """Unplug it."""
        self.stop()
        self._wire.unsubscribe(0x580 + self.node_id, self)

    def keep_reading(
        self, objects: Sequence[Key] = EVERYTHING, period_s: float = PERIOD_S, *, blocks: bool = False
    ) -> None:
        """Read them in turn, one every `period_s`, until `stop()`; in blocks if the node supports that."""
        self.stop()
        turns = cycle(objects)

        def step() -> None:
            self._timer = self._timers.call_later(period_s, step)
            self.read(*next(turns), block=blocks)

        step()

    def stop(self) -> None:
        """Stop sending periodic requests."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def read(self, index: int, sub: int = 0, *, block: bool = False) -> None:
        """Request an object."""
        command = b"\xa4" if block else b"\x40"
        tail = bytes((BLOCK, 0, 0, 0)) if block else bytes(4)
        self._ask(command + _multiplexer(index, sub) + tail)

    def write(self, index: int, sub: int, value: int, size: int) -> None:
        """Write up to 4 bytes into an object."""
        command = bytes((0x23 | (4 - size) << 2,))
        self._ask(command + _multiplexer(index, sub) + value.to_bytes(size, "little").ljust(4, b"\0"))

    def nmt(self, command: int, node_id: int | None = None) -> None:
        """Start (1), stop (2), pre-operational (0x80), reset (0x81, 0x82); node 0: all."""
        self._wire.send(0x000, bytes((command, self.node_id if node_id is None else node_id)))

    def guard(self) -> None:
        """Request the node's state by a remote frame, as masters without heartbeat support do."""
        self._wire.send_remote(GUARD + self.node_id)

    def look_for_unconfigured(self) -> None:
        """LSS: ask which nodes have no id yet (CiA 305)."""
        self._wire.send(LSS_MASTER, b"\x4c" + bytes(7))

    def _ask(self, request: bytes) -> None:
        self.seen.asked += 1
        self._wire.send(0x600 + self.node_id, request)

    def _go_on(self, frame: bytes) -> None:
        self._wire.send(0x600 + self.node_id, frame.ljust(8, b"\0"))

    def _hear(self, _: int, data: bytes) -> None:
        if len(data) != 8:
            return
        if self._block and self._segments and data[0] & 0x7F == self._segments:
            self._on_segment(data[0])
            return
        command = data[0]
        if command == 0x80:
            self.seen.aborts += 1
            self._block, self._segments = False, 0
        elif command == 0x60:
            self.seen.written += 1
        elif command & 0xE3 == 0x43:
            self.seen.values += 1
        elif command in (0x40, 0x41):
            self._toggle = 0
            self._go_on(b"\x60")
        elif command < 0x20:
            self._on_upload(command)
        elif command & 0xE1 == 0xC0:
            self._block, self._segments = True, 1
            self._go_on(b"\xa3")
        elif command & 0xE3 == 0xC1 and self._block:
            self._block = False
            self.seen.texts += 1
            self._go_on(b"\xa1")

    def _on_upload(self, command: int) -> None:
        if command & 1:
            self.seen.texts += 1
            return
        self._toggle ^= 0x10
        self._go_on(bytes((0x60 | self._toggle,)))

    def _on_segment(self, first: int) -> None:
        number = first & 0x7F
        self._segments = number + 1
        if first & 0x80 or number == BLOCK:
            self._segments = 0
            self._go_on(bytes((0xA2, number, BLOCK)))


def _multiplexer(index: int, sub: int) -> bytes:
    return index.to_bytes(2, "little") + bytes((sub,))
