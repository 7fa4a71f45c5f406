"""A stretch of a charge in which the BMU's SOC rises without a jump, and what flowed meanwhile. Pure.

It runs from one rise of the SOC to another. At the moment of a rise the true figure is the same fraction above or
below the one shown, however the BMU rounds: whole percents cost nothing then, only the time between two readings does.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from orchestrator.record.stamp import figure

#: A SOC that rises by more at once was corrected, not counted; one that falls by less wavers between two figures.
JUMP_PCT, WAVER_PCT = 2.0, 1.0
#: Above this many BMUs wait for the end of the charge before they say 100 %.
TOP_PCT = 99.0
#: No figure of a battery is larger, in V, A, Ah or °C: one that is was damaged.
MOST = 1e6


@dataclass(frozen=True, slots=True)
class Point:
    """One moment of a charge; None where nothing fresh is known."""

    t_s: float  #: when volts and current were requested, by the monotonic clock
    soc_pct: float | None
    pack_v: float | None
    pack_a: float | None
    temperature_c: float | None
    charger_ah: float  #: since the begin of the charge …
    bmu_ah: float  #: … by the BMU's current


@dataclass(frozen=True, slots=True)
class Stretch:
    """What flowed between two rises of the SOC."""

    from_pct: float
    to_pct: float
    charger_ah: float
    bmu_ah: float
    lowest_c: float
    highest_c: float

    @property
    def rise_pct(self) -> float:
        """How far the SOC rose."""
        return self.to_pct - self.from_pct


@dataclass(frozen=True, slots=True)
class Stretches:
    """The longest one so far, and the present one."""

    longest: Stretch | None = None
    soc_pct: float | None = None  #: the highest of the present stretch; None: it has not begun
    began: Point | None = None  #: its first rise
    ended: Point | None = None  #: its last one
    lowest_c: float = 0.0
    highest_c: float = 0.0

    @property
    def best(self) -> Stretch | None:
        """The longest, the present one included."""
        began, ended = self.began, self.ended
        if began is None or ended is None or began.soc_pct is None or ended.soc_pct is None:
            return self.longest
        ah, bmu_ah = ended.charger_ah - began.charger_ah, ended.bmu_ah - began.bmu_ah
        now = Stretch(began.soc_pct, ended.soc_pct, ah, bmu_ah, self.lowest_c, self.highest_c)
        return self.longest if self.longest is not None and self.longest.rise_pct >= now.rise_pct else now


def follow(known: Stretches, point: Point) -> Stretches:
    """The same after one more moment."""
    soc_pct, pack_c = point.soc_pct, point.temperature_c
    if soc_pct is None or pack_c is None or point.pack_a is None:
        return broken(known)
    if known.soc_pct is None:
        return Stretches(known.longest, soc_pct)
    rise_pct = soc_pct - known.soc_pct
    if rise_pct > JUMP_PCT or rise_pct < -WAVER_PCT:
        return Stretches(known.best, soc_pct)
    if rise_pct > 0 and soc_pct <= TOP_PCT:
        if known.began is None:
            return Stretches(known.longest, soc_pct, point, None, pack_c, pack_c)
        low_c, high_c = min(known.lowest_c, pack_c), max(known.highest_c, pack_c)
        return Stretches(known.longest, soc_pct, known.began, point, low_c, high_c)
    if known.began is None or known.lowest_c <= pack_c <= known.highest_c:
        return known
    return replace(known, lowest_c=min(known.lowest_c, pack_c), highest_c=max(known.highest_c, pack_c))


def broken(known: Stretches) -> Stretches:
    """The same after a gap in which current may have flowed unseen."""
    return known if known.soc_pct is None else Stretches(known.best)


def as_fields(best: Stretch | None) -> dict[str, float] | None:
    """As it stands in a record."""
    if best is None:
        return None
    return {
        "from_pct": best.from_pct,
        "to_pct": best.to_pct,
        "charger_ah": round(best.charger_ah, 4),
        "bmu_ah": round(best.bmu_ah, 4),
        "lowest_c": best.lowest_c,
        "highest_c": best.highest_c,
    }


def from_fields(value: Mapping[str, Any] | None) -> Stretch | None:
    """The inverse; raises LookupError, TypeError or ValueError for anything else."""
    if value is None:
        return None
    names = ("from_pct", "to_pct", "charger_ah", "bmu_ah", "lowest_c", "highest_c")
    from_pct, to_pct, charger_ah, bmu_ah, low_c, high_c = (measure(value[name]) for name in names)
    if not 0 <= from_pct <= to_pct <= 100:
        raise ValueError(f"a stretch from {from_pct:g} to {to_pct:g} % SOC is damaged")
    return Stretch(from_pct, to_pct, charger_ah, bmu_ah, low_c, high_c)


def measure(value: object) -> float:
    """A figure that can have been measured; ValueError for anything else."""
    found = figure(value)
    if abs(found) > MOST:
        raise ValueError(f"{found:g} cannot have been measured")
    return found
