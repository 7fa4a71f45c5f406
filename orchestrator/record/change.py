"""Changes of the current, each with the volts before and after it: what resistance is measured by. Pure.

Every change counts that is large and quick, whoever made it: a begin, an end, another current step. Volts and current
are of one reading of the BMU, so the leads from the charger have no part in it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from orchestrator.record.stretch import Point, measure

#: Two readings in a row that differ by no more are of a steady current.
STEADY_A, STEADY_SHARE = 0.1, 0.01
#: A smaller change drowns in the resolution of the volts.
LEAST_A = 1.5
#: Between the steady currents before and after: longer, and the cells' slow voltage counts as resistance.
LONGEST_S = 6.0
#: Readings further apart are no pair.
PAIR_S = 2.0
#: Of more changes of one charge the largest are kept.
MOST = 20


@dataclass(frozen=True, slots=True)
class Change:
    """One change of the current."""

    before_a: float
    after_a: float
    rise_v: float  #: of the pack's voltage, of the current's sign
    soc_pct: float
    temperature_c: float

    @property
    def rise_a(self) -> float:
        """How far the current rose."""
        return self.after_a - self.before_a


@dataclass(frozen=True, slots=True)
class Changes:
    """Those of one charge, and what the next one is measured from."""

    all: tuple[Change, ...] = ()
    steady: Point | None = None  #: the last reading of a steady current
    last: Point | None = None


def follow(known: Changes, point: Point) -> Changes:
    """The same after one more moment."""
    last, amps = known.last, point.pack_a
    if amps is None or point.pack_v is None:
        return broken(known)
    if last is not None and point.t_s <= last.t_s:
        return known
    if last is None or last.pack_a is None or point.t_s - last.t_s > PAIR_S:
        return Changes(known.all, None, point)
    if abs(amps - last.pack_a) > max(STEADY_A, STEADY_SHARE * abs(amps)):
        return replace(known, last=point)
    change = _between(known.steady, point)
    return Changes(known.all if change is None else _kept((*known.all, change)), point, point)


def broken(known: Changes) -> Changes:
    """The same after a gap."""
    return known if known.last is None else Changes(known.all)


def _between(before: Point | None, after: Point) -> Change | None:
    if before is None or after.t_s - before.t_s > LONGEST_S:
        return None
    if before.pack_a is None or after.pack_a is None or before.pack_v is None or after.pack_v is None:
        return None
    soc_pct, pack_c = after.soc_pct, after.temperature_c
    if soc_pct is None or pack_c is None or abs(after.pack_a - before.pack_a) < LEAST_A:
        return None
    return Change(before.pack_a, after.pack_a, after.pack_v - before.pack_v, soc_pct, pack_c)


def _kept(changes: Sequence[Change]) -> tuple[Change, ...]:
    if len(changes) <= MOST:
        return tuple(changes)
    smallest = min(changes, key=lambda one: abs(one.rise_a))
    return tuple(one for one in changes if one is not smallest)


def as_fields(changes: Iterable[Change]) -> list[list[float]]:
    """As they stand in a record: their figures in the order of `Change`; every checkpoint repeats them."""
    return [[one.before_a, one.after_a, round(one.rise_v, 4), one.soc_pct, one.temperature_c] for one in changes]


def from_fields(values: Iterable[Iterable[object]]) -> tuple[Change, ...]:
    """The inverse; raises TypeError or ValueError for anything else."""
    return tuple(Change(*map(measure, one)) for one in values)
