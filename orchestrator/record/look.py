"""What one decision shows of the charge in its bay: the fold's input. Pure."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

from orchestrator.core.states import ENERGISED
from orchestrator.model import Cause, Decision, Measurement, Session, Snapshot
from orchestrator.model.cause import plain
from orchestrator.record.stamp import Stamp

#: A value requested longer ago than this is not one of the present (the slowest are read once a second).
FRESH_S = 3.0
#: What is kept of the battery and of the charger, by the names that the status has for the battery's …
BATTERY = ("soc_pct", "soh_pct", "voltage_v", "current_a", "temperature_c")
CHARGER = ("voltage_v", "current_a")
#: … and all of them as records name them.
VALUES = ("soc_pct", "soh_pct", "pack_v", "pack_a", "temperature_c", "charger_v", "charger_a")


@dataclass(frozen=True, slots=True)
class Foreseen:
    """How long a charge still takes."""

    target_pct: float
    bmu_min: float | None  #: by its BMU
    own_min: float | None  #: by our own estimate


def _nothing() -> None:
    """Nothing is foreseen."""


@dataclass(frozen=True, slots=True)
class Look:
    """One decision, what it was made from, and when, by both clocks."""

    stamp: Stamp
    snapshot: Snapshot
    decision: Decision
    told: Callable[[Cause], Cause | None]  #: the cause with its moments as the time of day
    foresee: Callable[[], Foreseen | None] = _nothing

    @property
    def now_s(self) -> float:
        """By the monotonic clock."""
        return self.stamp.mono_s

    @property
    def session(self) -> Session | None:
        """The core's open charge, or the one that has just ended."""
        return self.decision.session

    @property
    def runs(self) -> bool:
        """Whether the charger is told to run."""
        return self.decision.state in ENERGISED

    def plainly(self, cause: Cause) -> dict[str, object]:
        """The cause as a record has it."""
        return {**plain(self.told(cause) or cause)}

    def values(self) -> tuple[float | None, ...]:
        """The present values, in the order of `VALUES`; None where nothing fresh is known."""
        battery, reading = self.snapshot.battery, self.snapshot.charger
        heard = reading is not None and self._is_fresh(reading.t_s)
        return (
            *(self.fresh(getattr(battery, name)) for name in BATTERY),
            *(_finite(getattr(reading, name)) if heard else None for name in CHARGER),
        )

    def fresh(self, measurement: Measurement | None) -> float | None:
        """Its value, unless it is too old."""
        if measurement is None or not self._is_fresh(measurement.t_s):
            return None
        return _finite(measurement.value)

    def _is_fresh(self, t_s: float) -> bool:
        return abs(self.now_s - t_s) <= FRESH_S


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
