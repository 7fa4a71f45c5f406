"""What was foreseen at the begin of a charge: how long it would take, by its BMU and by ourselves. Pure.

The record has the forecast beside what came of it: whoever doubts forecasts can see how far to believe them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from orchestrator.record.look import Foreseen, Look
from orchestrator.record.stamp import figure

#: It is asked for this often, until there is one, and not later than this after the begin.
EVERY_S, LATEST_S = 10.0, 600.0
#: Our own estimate waits until the current is steady; after this the BMU's counts alone.
ALONE_S = 120.0
#: The member of a record.
NAME = "forecast"


@dataclass(frozen=True, slots=True)
class Forecast:
    """Of one charge."""

    made: Foreseen | None = None  #: None: not yet, or nothing sensible could be said
    elapsed_s: float = 0.0  #: when that was, from the begin of the charge
    next_s: float = 0.0  #: when it is asked for again, by the monotonic clock


def follow(known: Forecast, look: Look, elapsed_s: float) -> Forecast:
    """The same after one more decision."""
    if known.made is not None or not look.runs or look.now_s < known.next_s or elapsed_s > LATEST_S:
        return known
    made = look.foresee()
    if made is None or (made.own_min is None and (made.bmu_min is None or elapsed_s < ALONE_S)):
        return replace(known, next_s=look.now_s + EVERY_S)
    return Forecast(made, elapsed_s)


def took_min(known: Forecast, lasted_s: float) -> float | None:
    """What came of it: how long the charge, which became full, took from then on."""
    return None if known.made is None else round((lasted_s - known.elapsed_s) / 60, 1)


def as_fields(known: Forecast) -> dict[str, object]:
    """As it stands in a record; null where nothing could be said."""
    made = known.made
    return {
        NAME: made
        and {
            "elapsed_s": round(known.elapsed_s, 1),
            "target_pct": made.target_pct,
            "bmu_min": made.bmu_min,
            "own_min": None if made.own_min is None else round(made.own_min, 1),
        }
    }


def from_fields(record: Mapping[str, Any]) -> Forecast:
    """The inverse; nothing for a record of an earlier version. Raises LookupError, TypeError or ValueError."""
    value = record.get(NAME)
    if value is None:
        return Forecast()
    bmu_min, own_min = (None if value[name] is None else figure(value[name]) for name in ("bmu_min", "own_min"))
    return Forecast(Foreseen(figure(value["target_pct"]), bmu_min, own_min), figure(value["elapsed_s"]))
