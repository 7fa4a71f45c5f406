"""What of the devices' news needs a decision at once; everything else waits for the bay's next tick.

Theory of operation. While a bay charges or rests, its devices report slightly other volts and amperes several times a
second, and nearly all of that changes no decision. What does is known: a report that says anything else than before, a
value that reaches a bound, or one that has moved further than a policy's tolerances. A tick is short, so what is not
told here is still decided on in time; in all other states every piece of news is. A tick is longer where nothing is on
its way: at rest, and in a charge in which no fault is seen. Even then no value gets too old unnoticed.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter
from typing import Self

from orchestrator.core.facts import CHARGER_STALE_S, FAST_STALE_S
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.core.states import ENERGISED, QUIET
from orchestrator.model import (
    BatteryLink,
    BatteryReading,
    ChargerLink,
    ChargerReading,
    Decision,
    Measurement,
    Snapshot,
    State,
)

STEADY = ENERGISED | QUIET
#: A change by this much since the last decision is news: below what two honest instruments may differ by.
MOVED_V, MOVED_A, MOVED_K = 0.1, 0.5, 0.5

REPORT = attrgetter(*(name for name in ChargerReading.__slots__ if name not in ("t_s", "voltage_v", "current_a")))
#: A heartbeat is missed by the tick; counters of the line's quality are for status and slow faults.
CHARGER_LINK = attrgetter(*(name for name in ChargerLink.__slots__ if name not in ("bad_frames", "bad_pct")))
BATTERY_LINK = attrgetter(*(name for name in BatteryLink.__slots__ if name not in ("heartbeat_t_s", "bad_frames")))

Bounds = tuple[float, ...]

#: A bay without news is decided this often, and this often where nothing is on its way.
TICK_S, CALM_TICK_S = 0.2, 0.5


@dataclass(frozen=True, slots=True)
class News:
    """The bounds of one bay, by quantity."""

    volts: Bounds
    charger_a: Bounds
    pack_c: Bounds

    @classmethod
    def of(cls, rules: Rules) -> Self:
        """Everything at which a charge is stopped."""
        limits = (*rules.steps_a, rules.bay.limits.current_a)
        temperatures = (rules.temperature_c.low, rules.temperature_c.high, rules.policy.faults.temperature_trip_c)
        return cls((rules.max_v,), tuple(map(rules.measured_most_a, limits)), temperatures)

    def matters(
        self,
        decided: Decision,
        known: Snapshot,
        charger: tuple[ChargerReading | None, ChargerLink],
        battery: tuple[BatteryReading, BatteryLink],
    ) -> bool:
        """Whether a decision cannot wait. `known` is what the last one, `decided`, was made on."""
        if decided.command is not None or decided.state not in STEADY:
            return True
        (reading, charger_link), (values, battery_link) = charger, battery
        links = CHARGER_LINK(charger_link), BATTERY_LINK(battery_link)
        if links != (CHARGER_LINK(known.charger_link), BATTERY_LINK(known.battery_link)):
            return True
        return self._charger_moved(known.charger, reading) or self._battery_moved(known.battery, values)

    def _charger_moved(self, before: ChargerReading | None, now: ChargerReading | None) -> bool:
        if now is before:
            return False
        if now is None or before is None or REPORT(now) != REPORT(before):
            return True
        return _moved(before.voltage_v, now.voltage_v, MOVED_V, self.volts) or _moved(
            before.current_a, now.current_a, MOVED_A, self.charger_a
        )

    def _battery_moved(self, before: BatteryReading, now: BatteryReading) -> bool:
        return (
            _differs(before.status, now.status, 1.0)
            or _differs(before.voltage_v, now.voltage_v, MOVED_V, self.volts)
            or _differs(before.current_a, now.current_a, MOVED_A)
            or _differs(before.temperature_c, now.temperature_c, MOVED_K, self.pack_c)
        )


def _differs(before: Measurement | None, now: Measurement | None, by: float, bounds: Iterable[float] = ()) -> bool:
    if now is before:
        return False
    return now is None or before is None or _moved(before.value, now.value, by, bounds)


def _moved(before: float, now: float, by: float, bounds: Iterable[float]) -> bool:
    """Whether a value has moved so far, or has come to a bound or over it."""
    if now == before:
        return False
    low, high = (before, now) if before < now else (now, before)
    return not high - low < by or any(low <= bound <= high for bound in bounds)  # what is not a number has moved


def due_s(
    decided_s: float, decision: Decision, memory: Memory, reading: ChargerReading | None, values: BatteryReading
) -> float:
    """When the next decision is due at the latest: after one made at `decided_s`, with these newest values."""
    soon_s, later_s = decided_s + TICK_S, decided_s + CALM_TICK_S
    if decision.command is not None:
        return soon_s
    if decision.state in QUIET:
        return later_s
    if decision.state is not State.CHARGING or memory.faults:
        return soon_s
    read_s = [value.t_s for value in (values.voltage_v, values.current_a, values.temperature_c) if value is not None]
    old_s = (
        min(read_s, default=decided_s) + FAST_STALE_S,
        (reading.t_s if reading is not None else decided_s) + CHARGER_STALE_S,
    )
    return max(soon_s, min(later_s, *old_s))
