"""The supplies of a station and the chargers on them, in whole watts: what `allocate()` divides, and among whom.

Theory of operation. A bay's *level* is 0 for a charger in standby and k for its k-th current step. Each level has a
worst-case power. Watts are integers, draws rounded up and limits down, so that sums are exact. A bay *counts* with the
highest level that its charger may be at, as far as anybody can tell; what a bay was granted never exceeds that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from math import inf

from orchestrator.model import Cause


class Priority(IntEnum):
    """The three classes. A class gets all it wants before the next one gets anything."""

    FIRST = 0
    NORMAL = 1
    LAST = 2


@dataclass(frozen=True, slots=True)
class Supply:
    """One fuse or feed. What is within it counts in it as well."""

    name: str
    limit_w: int
    within: str | None = None
    place: str = ""  #: where the limit is set: FILE:LINE


@dataclass(frozen=True, slots=True)
class Load:
    """A bay's charger on its supply."""

    bay: str
    supply: str  #: the one that it is directly on
    draw_w: tuple[int, ...]  #: the worst case of each level, not falling: standby, then the steps

    @property
    def top(self) -> int:
        """Its highest level."""
        return len(self.draw_w) - 1


@dataclass(frozen=True, slots=True)
class Supplies:
    """All supplies, and the bays on them; wants, holdings and grants come in the order of `loads`."""

    supplies: tuple[Supply, ...]
    limits_w: tuple[int, ...]
    loads: tuple[Load, ...]
    paths: tuple[tuple[int, ...], ...]  #: for each bay the supplies in which it counts, its own first

    @classmethod
    def of(cls, supplies: Sequence[Supply], loads: Sequence[Load]) -> "Supplies":
        """The tree. Its names must be known and free of cycles, as those of a station file are."""
        number = {supply.name: index for index, supply in enumerate(supplies)}

        def above(name: str | None) -> tuple[int, ...]:
            return () if name is None else (number[name], *above(supplies[number[name]].within))

        limits_w = tuple(supply.limit_w for supply in supplies)
        return cls(tuple(supplies), limits_w, tuple(loads), tuple(above(load.supply) for load in loads))

    def limited(self, limits_w: Mapping[str, int]) -> "Supplies":
        """The same with lower limits for now; one above the station file's changes nothing."""
        now_w = tuple(min(supply.limit_w, limits_w.get(supply.name, supply.limit_w)) for supply in self.supplies)
        return replace(self, limits_w=now_w)


@dataclass(frozen=True, slots=True)
class Want:
    """What a bay asks for now."""

    top: int = 0  #: the highest level that everything else allows; 0: it does not charge
    priority: Priority = Priority.NORMAL
    laxity_s: float = inf  #: time left until it must be done minus the time that it still takes; inf: no hurry
    keeps: bool = False  #: in a precharge or a constant-voltage tail, which fairness does not interrupt


@dataclass(frozen=True, slots=True)
class Held:
    """What a bay has, carried from one allocation to the next. Made by `ledger.py` and `allocate.py` alone."""

    counted: int  #: the highest level not disproved; never below `granted`
    granted: int = 0
    known: bool = False  #: its charger answers and is in hand; otherwise it counts with its highest level
    lowered_s: float = -inf  #: when the grant was last lowered: only a later status disproves a level
    rose_s: float = -inf  #: when it was last raised
    room_s: float | None = None  #: since when a higher level has been planned
    turn_s: float | None = None  #: since when it has its place, with its lowest level
    waits_s: float | None = None  #: since when it waits for one


@dataclass(frozen=True, slots=True)
class Grant:
    """The highest level that a bay may use from now on."""

    level: int
    cause: Cause | None  #: what binds it; None: it has all that it wants
    held: Held
