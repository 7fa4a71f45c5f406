"""A sender that answers in a node's name: a second BMU with the same id, a broken gateway, or an attacker."""

import random
from dataclasses import dataclass
from enum import Enum

from orchestrator.sim.timers import Timer, Timers, Wire

TEMPERATURE = 0x6004
COLD = 200  #: 20.0 °C, the false value for a hot pack


class When(Enum):
    """When the forged answer is sent."""

    FIRST = "before the node answers, at once when it is asked"
    AFTER = "as soon as the node has answered"
    SOMETIMES = "before or after the node, now and then"
    UNASKED = "each `period_s`, whether anybody asks or not"


@dataclass(frozen=True, slots=True)
class Lie:
    """The forged answer that replaces the node's own."""

    index: int = TEMPERATURE
    word: int = COLD
    size: int = 4  #: bytes declared by the answer
    abort: int = 0  #: an abort code instead of a value
    when: When = When.AFTER
    share: float = 1.0  #: share of the answers, for SOMETIMES
    period_s: float = 0.05  #: for UNASKED

    def answer(self, sub: int = 0) -> bytes:
        """The forged frame."""
        multiplexer = self.index.to_bytes(2, "little") + bytes((sub,))
        if self.abort:
            return b"\x80" + multiplexer + self.abort.to_bytes(4, "little")
        word = self.word & (1 << 8 * self.size) - 1
        return bytes((0x43 | (4 - self.size) << 2,)) + multiplexer + word.to_bytes(4, "little")


class Forger:
    """Forges one node's answers from its creation on. Belongs to the thread of its clock.

    To hear other senders on its own wire, it needs the same as `second_master.SecondMaster`.
    """

    def __init__(self, timers: Timers, wire: Wire, node_id: int, lie: Lie, seed: int = 1) -> None:
        self.told = 0  #: forged answers sent
        self.node_id = node_id
        self._timers, self._wire, self._lie = timers, wire, lie
        self._random = random.Random(seed)  # noqa: S311 - chance, not a secret
        self._timer: Timer | None = None
        self._asked = 0  # unanswered requests
        wire.subscribe(0x600 + node_id, self, self._hear_request)
        wire.subscribe(0x580 + node_id, self, self._hear_answer)
        if lie.when is When.UNASKED:
            self._tick()

    def close(self) -> None:
        """Unplug it."""
        self._wire.unsubscribe(0x600 + self.node_id, self)
        self._wire.unsubscribe(0x580 + self.node_id, self)
        if self._timer is not None:
            self._timer.cancel()

    def _hear_request(self, _: int, data: bytes) -> None:
        if data[:1] != b"\x40" or int.from_bytes(data[1:3], "little") != self._lie.index:
            return
        when = self._lie.when
        if when is When.SOMETIMES:
            if self._random.random() >= self._lie.share:
                return
            when = self._random.choice((When.FIRST, When.AFTER))
        if when is When.FIRST:
            self._tell(data[3])
        elif when is When.AFTER:
            self._asked += 1

    def _hear_answer(self, _: int, data: bytes) -> None:
        if self._asked and int.from_bytes(data[1:3], "little") == self._lie.index:
            self._asked = 0  # so that its own echo triggers nothing
            self._tell(data[3])

    def _tick(self) -> None:
        self._timer = self._timers.call_later(self._lie.period_s, self._tick)
        self._tell(0)

    def _tell(self, sub: int) -> None:
        self.told += 1
        self._wire.send(0x580 + self.node_id, self._lie.answer(sub))
