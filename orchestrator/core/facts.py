"""What is true of a bay now: ages, validity and comparisons, worked out once per decision for everything that decides.

A value here is a fresh, finite number, or None. Nothing downstream checks a reading's age again.
"""

from collections.abc import Container
from dataclasses import dataclass
from math import inf, isfinite

from orchestrator.core.memory import Memory
from orchestrator.core.parts import made
from orchestrator.core.rules import Rules
from orchestrator.core.states import ENERGISED
from orchestrator.core.witnesses import standby
from orchestrator.model import (
    BatteryLink,
    Cause,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Measurement,
    Operation,
    Snapshot,
    State,
)

#: A status reply counts as the charger's present state for this long. Five misses are found earlier, even when commands
#: and polls take turns (0.4 s each); this is for a port that no longer polls at all.
CHARGER_STALE_S = 1.5
#: Volts, amps, status and temperature of the pack: at most three sweeps.
FAST_STALE_S = 1.5
#: The objects read once a second: three readings.
SLOW_STALE_S = 3.0
#: If this service stood still, its devices are judged silent only after this long: nobody could have heard them.
ANSWER_S = FAST_STALE_S
#: A BMU that answers has reported voltage, current, status or temperature within this time.
QUIET_S = 0.6
#: Right after its boot a BMU reports what its memory held, not what it measured.
SETTLE_S = 1.0
#: Standby may show this much: the resolution and offset of a charger's current measurement.
STANDBY_A = 0.5
#: Below this the charger sees no battery at its terminals.
TERMINAL_V = 5.0


NONE: frozenset[str] = frozenset()


def _fresh(measurement: Measurement | None, now_s: float, oldest_s: float) -> float | None:
    """The value, if it is reliable. A time in the future is as wrong as one too long ago."""
    if measurement is None or not oldest_s <= measurement.t_s <= now_s + FAST_STALE_S:
        return None
    return measurement.value if isfinite(measurement.value) else None


def _valid(reading: ChargerReading | None, now_s: float) -> ChargerReading | None:
    if reading is None or not abs(now_s - reading.t_s) <= CHARGER_STALE_S:
        return None
    return reading if isfinite(reading.voltage_v) and isfinite(reading.current_a) else None


@dataclass(frozen=True, slots=True)
class Facts:
    """What is true now. Updating the memory, or finding something that cannot be judged, makes new facts."""

    now_s: float
    snapshot: Snapshot
    memory: Memory
    rules: Rules
    reading: ChargerReading | None
    charger: ChargerLink
    battery: BatteryLink
    volts: float | None
    amps: float | None
    slow_from_s: float
    pack_v: float | None
    pack_a: float | None
    status: float | None
    temperature_c: float | None
    soc: float | None
    soh: float | None
    connected: bool
    energised: bool  #: as the previous decision left the bay; so are the next two
    state_s: float
    raised: Container[str]  #: ids of the active faults; for thresholds with hysteresis
    broken: tuple[Cause, ...] = ()  #: our own checks that could not be judged in this decision

    @classmethod
    def of(cls, now_s: float, snapshot: Snapshot, memory: Memory, rules: Rules) -> "Facts":
        """The facts in this snapshot."""
        reading, battery, link = _valid(snapshot.charger, now_s), snapshot.battery, snapshot.battery_link
        settled_s = link.boot_t_s + SETTLE_S if link.boot_t_s is not None else -inf
        fast_s, slow_s = max(now_s - FAST_STALE_S, settled_s), max(now_s - SLOW_STALE_S, settled_s)
        return made(
            cls,
            now_s,
            snapshot,
            memory,
            rules,
            reading,
            snapshot.charger_link,
            link,
            reading.voltage_v if reading else None,
            reading.current_a if reading else None,
            slow_s,
            _fresh(battery.voltage_v, now_s, fast_s),
            _fresh(battery.current_a, now_s, fast_s),
            _fresh(battery.status, now_s, fast_s),
            _fresh(battery.temperature_c, now_s, fast_s),
            _fresh(battery.soc_pct, now_s, slow_s),
            _fresh(battery.soh_pct, now_s, slow_s),
            snapshot.connected,
            memory.state in ENERGISED,
            now_s - memory.since_s if memory.since_s is not None else 0.0,
            frozenset(name for name, fault in memory.faults.items() if fault.raised_s is not None)
            if memory.faults
            else NONE,
            (),
        )

    def with_memory(self, memory: Memory) -> "Facts":
        """The same facts with another memory. (Written out, since every decision does this several times.)"""
        return made(
            Facts, self.now_s, self.snapshot, memory, self.rules, self.reading, self.charger, self.battery, self.volts,
            self.amps, self.slow_from_s, self.pack_v, self.pack_a, self.status, self.temperature_c, self.soc, self.soh,
            self.connected, self.energised, self.state_s, self.raised, self.broken,
        )  # fmt: skip

    def slow(self, measurement: Measurement | None) -> float | None:
        """A value of the slow objects that only few rows look at, if it is reliable."""
        return _fresh(measurement, self.now_s, self.slow_from_s)

    @property
    def silent(self) -> bool:
        """The BMU reports nothing by which a charge is supervised."""
        return self.pack_v is None and self.temperature_c is None and self.status is None

    @property
    def quiet(self) -> bool:
        """None of these arrived lately: if one is too old, the BMU is silent, though the others are not too old yet."""
        battery = self.snapshot.battery
        often = (battery.voltage_v, battery.current_a, battery.status, battery.temperature_c)
        return self.now_s - max((one.t_s for one in often if one is not None), default=-inf) > QUIET_S

    @property
    def stalled(self) -> bool:
        """This service stood still, and the devices have had no time to answer since."""
        stalled_s = self.memory.stalled_s
        return stalled_s is not None and self.now_s - stalled_s < ANSWER_S

    @property
    def unheard(self) -> bool:
        """A device is not heard, as is to be expected right after a stall."""
        return self.stalled and (
            self.silent or self.reading is None or not (self.battery.online and self.charger.online)
        )

    @property
    def just_booted(self) -> bool:
        """Values from before the boot no longer count, and there was no time for new ones yet: that is no silence."""
        boot_s = self.battery.boot_t_s
        return boot_s is not None and self.now_s - boot_s < SETTLE_S + FAST_STALE_S

    @property
    def battery_removed(self) -> bool:
        """The battery was removed: its BMU is silent and the charger sees no voltage.

        Behind an open contactor the charger never sees one, so nothing is concluded there.
        """
        gone = self.volts is not None and self.volts < TERMINAL_V and self.connected
        return gone and self.silent and not self.battery.online

    @property
    def present(self) -> bool:
        """A battery is there, with fresh values for everything that a charge needs."""
        return None not in (self.pack_v, self.pack_a, self.status, self.temperature_c, self.soc, self.soh)

    @property
    def missing(self) -> tuple[str, ...]:
        """The values a charge needs that the BMU has not reported freshly."""
        values = {
            "voltage": self.pack_v,
            "current": self.pack_a,
            "status": self.status,
            "temperature": self.temperature_c,
            "soc": self.soc,
            "soh": self.soh,
        }
        return tuple(name for name, value in values.items() if value is None)

    @property
    def standby(self) -> bool:
        """The charger freshly reports that it is stopped and delivers nothing."""
        reading = self.reading
        return reading is not None and reading.operation is Operation.STOPPED and reading.current_a <= STANDBY_A

    @property
    def runs(self) -> bool:
        """The charger freshly reports that it runs or delivers current."""
        reading = self.reading
        return reading is not None and (reading.operation is Operation.RUNNING or reading.current_a > STANDBY_A)

    @property
    def unordered(self) -> bool:
        """The BMU keeps seeing a charging current without a command: whatever the charger reports, something runs."""
        return self.memory.witnessed.unordered_s >= standby.UNORDERED_S and standby.sees_current(self)

    @property
    def stopped(self) -> bool:
        """Both witnesses show standby after a stop that was sent in this state."""
        return standby.proved(self)

    @property
    def full_mode(self) -> bool:
        """The charger itself ended a charge that it was running (mode 5 is also plain standby)."""
        return (
            self.memory.state is State.CHARGING
            and self.memory.stage.ran
            and self.reading is not None
            and self.reading.charge_mode is ChargeMode.FULL
        )
