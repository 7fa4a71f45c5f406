"""Decides whose turn it is to begin a charge: one bay of a station after another, so that each is seen on its own BMU.

Theory of operation. Two equal packs with swapped cables or node ids look right to both bays: voltage and current agree,
and each pack is watched by the other one's BMU. Only the beginning of a charge exposes that. So a bay that is ready
waits for its turn; the turn ends when its own BMU has seen its first amperes, when it gives up, or after `TURN_S`; and
turns begin `stagger_s` apart. If another bay's BMU moves instead, the bay is told which, and stops (FAULTS P8).

Used by the control loop's thread only. A station with one bay has nobody to wait for.
"""

from dataclasses import dataclass, field
from math import inf

from orchestrator.core.memory import Memory
from orchestrator.core.states import ENERGISED
from orchestrator.core.witnesses.followed import FIRST_A, OWN_SHARE
from orchestrator.model import Cause, Snapshot, State

#: The longest turn: the charger's sequence takes 2 s on a good line, and its first amperes follow.
TURN_S = 20.0


@dataclass(frozen=True, slots=True)
class Amps:
    """The latest readings of a bay's two witnesses."""

    bmu: float = 0.0
    charger: float = 0.0


@dataclass(slots=True)
class Turn:
    """One bay's turn, and every bay's readings when its charge began."""

    name: str
    since_s: float
    began_s: float | None = None
    before: dict[str, Amps] = field(default_factory=dict)


class Starts:
    """Call `waits` and `moves` before a bay's decision, and `follow` after it."""

    def __init__(self, stagger_s: float, at: str) -> None:
        self._stagger_s, self._at = stagger_s, at
        self._turn: Turn | None = None
        self._began_s = -inf
        self._seen: dict[str, Amps] = {}
        self._moves = ""

    def waits(self, name: str, now_s: float) -> Cause | None:
        """Why this bay may not begin a charge now; None if it may."""
        if not self._stagger_s:
            return None
        turn = self._turn
        if turn is not None and now_s - turn.since_s > TURN_S:
            turn = self._turn = None
        if turn is not None:
            return None if turn.name == name else Cause.of("waits_for_turn", other=turn.name)
        return Cause.of("waits_for_stagger", key="stagger_s", place=self._at, stagger_s=self._stagger_s)

    def moves(self, name: str) -> str:
        """The other bay whose BMU has seen this bay's charge begin; "" if there is none."""
        return self._moves if self._turn is not None and self._turn.name == name else ""

    def follow(self, name: str, now_s: float, memory: Memory, snapshot: Snapshot) -> None:
        """Take note of a bay's decision; `memory` is its resulting memory."""
        bmu, charger = snapshot.battery.current_a, snapshot.charger
        self._seen[name] = Amps(bmu.value if bmu is not None else 0.0, charger.current_a if charger else 0.0)
        turn = self._turn
        if turn is None:
            if memory.stage.ready and now_s - self._began_s >= self._stagger_s:
                self._turn, self._moves = Turn(name, now_s), ""
        elif turn.name == name:
            self._go_on(turn, now_s, memory)

    def _go_on(self, turn: Turn, now_s: float, memory: Memory) -> None:
        if memory.state in ENERGISED:
            if turn.began_s is None:
                turn.began_s = self._began_s = now_s
                turn.before = dict(self._seen)
            self._moves = self._moved(turn)
            over = memory.witnessed.proved
        else:
            over = memory.state is not State.QUALIFYING or not memory.stage.ready
        if over:
            self._turn = None

    def _moved(self, turn: Turn) -> str:
        """The other bay whose BMU has risen by this charger's current, and not by its own charger's."""
        flows_a = self._seen[turn.name].charger
        if flows_a < FIRST_A:
            return ""

        def rise(name: str) -> float:
            now, before = self._seen[name], turn.before.get(name, Amps())
            return (now.bmu - before.bmu) - (now.charger - before.charger)

        others = [name for name in self._seen if name != turn.name]
        found = max(others, key=rise, default="")
        return found if found and rise(found) >= OWN_SHARE * flows_a else ""
