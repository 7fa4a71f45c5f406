"""When a charge did not go on, and why. Pure.

A pause begins when the charger is told to stop and ends when it is told to run again. It is one only once the charger
is verified, or not heard any more: a stop that ends the charge is no pause.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from orchestrator.core.states import UNVERIFIED
from orchestrator.record import stamp as stamps
from orchestrator.record.look import Look
from orchestrator.record.stamp import Stamp, figure

#: Of more pauses only the number and the length are kept.
MOST = 100

Plain = Mapping[str, object]  #: a cause in a record


@dataclass(frozen=True, slots=True)
class Pause:
    """One pause; `lasted_s` is None while it lasts."""

    cause: Plain
    began: Stamp
    lasted_s: float | None = None


@dataclass(frozen=True, slots=True)
class Pauses:
    """All of one charge."""

    all: tuple[Pause, ...] = ()
    halted: Stamp | None = None  #: since when the charger has not been told to run; None: it is
    why: Plain | None = None  #: why, if that is known better than from the state that follows
    count: int = 0
    paused_s: float = 0.0

    @property
    def lasts(self) -> bool:
        """Whether there is one now."""
        return bool(self.all) and self.all[-1].lasted_s is None


def follow(pauses: Pauses, look: Look) -> Pauses:
    """The same after one more decision."""
    if look.runs:
        return replace(ended(pauses, look.stamp), halted=None, why=None)
    halted = pauses.halted or look.stamp
    if pauses.lasts or look.decision.state in UNVERIFIED:
        return pauses if pauses.halted is halted else replace(pauses, halted=halted)
    pause = Pause(pauses.why or look.plainly(look.decision.cause), halted)
    kept = pauses.all if len(pauses.all) < MOST else pauses.all[:-1]
    return replace(pauses, all=(*kept, pause), halted=halted, count=pauses.count + 1)


def ended(pauses: Pauses, now: Stamp) -> Pauses:
    """The same with the present pause ended."""
    if not pauses.lasts:
        return pauses
    *before, pause = pauses.all
    lasted_s = now.since(pause.began)
    return replace(pauses, all=(*before, replace(pause, lasted_s=lasted_s)), paused_s=pauses.paused_s + lasted_s)


def died(pauses: Pauses, last: Stamp, why: Plain) -> Pauses:
    """The same after a run of the service that ended without a word, `last` seen then."""
    return pauses if pauses.halted is not None else replace(pauses, halted=last, why=why)


def as_fields(pauses: Pauses) -> dict[str, object]:
    """As they stand in a record."""
    return {
        "pauses": [
            {
                "cause": one.cause,
                **stamps.as_fields(one.began),
                "lasted_s": None if one.lasted_s is None else round(one.lasted_s, 3),
            }
            for one in pauses.all
        ],
        "pause_count": pauses.count,
        "paused_s": round(pauses.paused_s, 3),
        "halted": pauses.halted and stamps.as_fields(pauses.halted),
    }


def from_fields(record: Mapping[str, Any]) -> Pauses:
    """The inverse; raises LookupError, TypeError or ValueError for anything else."""
    halted, found = record["halted"], record["pauses"]
    if not isinstance(found, Sequence):
        raise ValueError(f"{found!r:.80} is no list of pauses")
    return Pauses(
        tuple(map(_pause, found)),
        None if halted is None else stamps.from_fields(halted),
        None,
        int(figure(record["pause_count"])),
        figure(record["paused_s"]),
    )


def _pause(value: Mapping[str, Any]) -> Pause:
    if not isinstance(value["cause"], Mapping):
        raise ValueError(f"{value['cause']!r:.80} is no cause")
    lasted_s = value["lasted_s"]
    return Pause(value["cause"], stamps.from_fields(value), None if lasted_s is None else figure(lasted_s))
