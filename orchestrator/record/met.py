"""The faults that a charge met, and how its charger obeyed its stops. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from orchestrator.core.states import AT_REST, ENERGISED, MAY_RUN
from orchestrator.record.look import Look
from orchestrator.record.stamp import figure

#: The fault table is not longer; a file may be.
MOST = 200
#: A stop has been sent, and standby is not verified yet.
STOPPING = MAY_RUN - ENERGISED


@dataclass(frozen=True, slots=True)
class Met:
    """One fault: as it first came, and how often it has come."""

    id: str
    effect: str
    cause: Mapping[str, object]
    times: int = 1


@dataclass(frozen=True, slots=True)
class Trouble:
    """All faults of one charge, and its stops."""

    met: tuple[Met, ...] = ()
    active: tuple[str, ...] = ()  #: ids at the last decision
    stopping_s: float | None = None  #: since when a stop has been tried, by the monotonic clock
    verified_ms: float | None = None  #: how long the last stop took until it was verified
    longest_ms: float | None = None  #: … and the longest


def follow(trouble: Trouble, look: Look) -> Trouble:
    """The same after one more decision."""
    return _stops(_faults(trouble, look), look)


def _faults(trouble: Trouble, look: Look) -> Trouble:
    active = tuple(fault.id for fault in look.decision.faults)
    if active == trouble.active:
        return trouble
    met = {one.id: one for one in trouble.met}
    for fault in look.decision.faults:
        if fault.id in trouble.active:
            continue
        known = met.get(fault.id)
        if known is not None:
            met[fault.id] = replace(known, times=known.times + 1)
        elif len(met) < MOST:
            met[fault.id] = Met(fault.id, fault.effect.name, look.plainly(fault.raised or fault.cause))
    return replace(trouble, met=tuple(met.values()), active=active)


def _stops(trouble: Trouble, look: Look) -> Trouble:
    state = look.decision.state
    if state in STOPPING:
        return trouble if trouble.stopping_s is not None else replace(trouble, stopping_s=look.now_s)
    if trouble.stopping_s is None:
        return trouble
    if state not in AT_REST:  # not heard any more: nobody knows
        return replace(trouble, stopping_s=None)
    took_ms = (look.now_s - trouble.stopping_s) * 1000
    return replace(trouble, stopping_s=None, verified_ms=took_ms, longest_ms=max(took_ms, trouble.longest_ms or 0.0))


def as_fields(trouble: Trouble) -> dict[str, object]:
    """As they stand in a record."""
    return {
        "faults": [{"id": one.id, "effect": one.effect, "times": one.times, "cause": one.cause} for one in trouble.met],
        "stop_verified_ms": _rounded(trouble.verified_ms),
        "stop_longest_ms": _rounded(trouble.longest_ms),
    }


def from_fields(record: Mapping[str, Any]) -> Trouble:
    """The inverse; raises LookupError, TypeError or ValueError for anything else. What is active shows itself again."""
    met = tuple(
        Met(str(one["id"]), str(one["effect"]), dict(one["cause"]), int(figure(one["times"])))
        for one in record["faults"]
    )
    took_ms, longest_ms = (
        None if record[name] is None else figure(record[name]) for name in ("stop_verified_ms", "stop_longest_ms")
    )
    return Trouble(met, verified_ms=took_ms, longest_ms=longest_ms)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 1)
