"""A model of the charger, from its document (protocol 2/2 of 2025-08-08): what it obeys, delivers and says.

What the document leaves open is chosen to be dangerous rather than kind: the charger remembers its run command. Rest 0
puts it into standby, but rest 1 alone lets it run again unless operation 0 was sent meanwhile. Pure: time is an
argument.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from math import inf

from orchestrator.model import ChargeMode, Connection, ControlMode, Operation, Precharge
from orchestrator.sim import automatic
from orchestrator.sim.pack import Pack

#: Amperes per second while the output rises; it falls at once.
SOFT_START_A_PER_S = 20.0
#: A pulse of the precharge: this long on, then this long off.
PULSE_S = 1.0
#: In the constant-voltage phase below the cut-off current for this long: full.
FULL_AFTER_S = 3.0
#: A rogue charger starts by itself after standing still for this long.
ROGUE_AFTER_S = 2.0


class Push(IntEnum):
    """Which value a 0x02 frame sets (§3.3.2)."""

    OPERATION = 0x01
    CURRENT_LIMIT = 0x02
    CHARGE_MODE = 0x04
    PRECHARGE = 0x08


#: The values that the document allows for each (§4.2.1).
ALLOWED = {
    Push.OPERATION: range(2),
    Push.CURRENT_LIMIT: range(5),
    Push.CHARGE_MODE: range(3, 6),
    Push.PRECHARGE: range(3),
}


@dataclass(slots=True)
class SimulatedCharger:
    """One charger. `rest` and `push` are what its line brings, `advance` lets time pass, the rest is what it says."""

    control_mode: ControlMode = ControlMode.MANUAL
    steps_a: tuple[float, ...] = (2.0, 5.0, 8.0, 11.0, 14.0)
    cv_v: float = 54.6  #: constant voltage
    precharge_a: float = 1.0
    cutoff_a: float = 0.4  #: full below this in the constant-voltage phase
    lead_ohm: float = 0.005  #: between the charger's terminals and the battery's

    # what was commanded and is remembered
    run: bool = False
    resting: bool = False  #: standby by rest 0, until rest 1
    current_step: int = 0
    mode: ChargeMode = ChargeMode.FULL  #: commanded, or in automatic the present stage
    precharge: Precharge = Precharge.OFF

    # what is going on
    battery: bool = True  #: there is one at its terminals
    voltage_v: float = 0.0
    current_a: float = 0.0
    full: bool = False
    stage_s: float = 0.0  #: since the present stage of the output began
    taper_s: float = 0.0
    still_s: float = 0.0  #: since the output was last on

    # faults
    halted: ChargeMode | None = None  #: 7 or 8: stopped by itself
    reversed: bool = False
    rogue: bool = False  #: starts by itself, once
    gain: float = 1.0  #: what it delivers of what it should
    deaf_to: set[Push] = field(default_factory=set)  #: values that it no longer takes
    ignores_stop: bool = False
    stops_left: float = inf  #: obeys so many more stops of a running output, then none
    restless_s: float | None = None  #: runs again by itself, each time it has stood still for so long
    reverts_s: float | None = None  #: takes each current limit, and goes back to the highest after so long
    limit_s: float = 0.0  #: since the limit was set

    def __post_init__(self) -> None:
        if self.control_mode is ControlMode.AUTOMATIC:
            self.run, self.mode, self.current_step = True, ChargeMode.BATTERY_SEARCH, len(self.steps_a) - 1

    # --- what the line brings ---

    def rest(self, value: int) -> None:
        """0x10: 0 to standby, whatever it is doing; 1 from standby back to what was commanded."""
        if value == 0 and self._obeys_stop():
            self.resting = True
            self._begin()
            self.current_a = 0.0
        elif value == 1 and self.resting:
            self.resting = self.full = False
            if self.control_mode is ControlMode.AUTOMATIC:
                self.mode = ChargeMode.BATTERY_SEARCH
            self._begin()

    def push(self, what: int, value: int) -> None:
        """0x02: set one value; only in manual mode, only a documented value, and no run in standby."""
        if self.control_mode is not ControlMode.MANUAL or what not in ALLOWED or value not in ALLOWED[Push(what)]:
            return
        if what in self.deaf_to:
            return
        if what == Push.OPERATION:
            self._set_operation(run=value == 1)
        elif what == Push.CURRENT_LIMIT:
            self.current_step, self.limit_s = value, 0.0
        elif what == Push.CHARGE_MODE:
            if value != self.mode:
                self.full = False
                self._begin()
            self.mode = ChargeMode(value)
        else:
            self.precharge = Precharge(value)
            self._begin()

    def _set_operation(self, *, run: bool) -> None:
        if run and not self.resting:
            if not self.run or self.full:
                self._begin()
            self.run, self.full = True, False
        elif not run and self._obeys_stop():
            self.run, self.full, self.current_a = False, False, 0.0

    def _obeys_stop(self) -> bool:
        if self.running:
            self.stops_left -= 1
        return not self.ignores_stop and self.stops_left >= 0

    def _begin(self) -> None:
        self.stage_s = self.taper_s = 0.0

    # --- what it says ---

    @property
    def running(self) -> bool:
        """Whether its output is switched on (a pulse's pause included)."""
        standing = self.resting or self.full or self.reversed or self.halted is not None
        return self.run and not standing and self.mode is not ChargeMode.FULL

    @property
    def pulsing(self) -> bool:
        """Whether its output goes on and off by itself."""
        pulses = self.precharge is Precharge.PULSE or self.mode is ChargeMode.BATTERY_RECOVERY
        return pulses and self.running and self.mode is not ChargeMode.CHARGE

    @property
    def operation(self) -> Operation:
        """As it reports it."""
        return Operation.RUNNING if self.running else Operation.STOPPED

    @property
    def charge_mode(self) -> ChargeMode:
        """As it reports it: reversed and halted first, then standby and full, then what was commanded."""
        if self.reversed:
            return ChargeMode.REVERSED
        if self.halted is not None:
            return self.halted
        if self.resting or self.full:
            return ChargeMode.FULL
        return self.mode if self.battery or not self.run else ChargeMode.BATTERY_SEARCH

    @property
    def connection(self) -> Connection:
        """As it reports it."""
        return Connection.REVERSED if self.reversed else Connection.NORMAL

    # --- what time does ---

    def advance(self, dt_s: float, pack: Pack | None) -> None:
        """Let `dt_s` pass and set the output for the pack as it is now; `current_a` is what will flow next."""
        self.stage_s += dt_s
        self.battery = pack is not None
        if pack is None:
            self.voltage_v = self.current_a = 0.0
            if self.control_mode is ControlMode.AUTOMATIC:
                self.mode = ChargeMode.BATTERY_SEARCH
            return
        if self.control_mode is ControlMode.AUTOMATIC:
            self._next_stage(pack)
        self._start_by_itself(dt_s)
        self._go_back(dt_s)
        demand_a, room_a = self.demand_a, self.room_a(pack)
        self.current_a = self.output_a(dt_s, demand_a, room_a)
        self.voltage_v = pack.ocv_v + self.current_a * (pack.series_ohm + self.lead_ohm)
        self._watch_taper(dt_s, tapering=demand_a > room_a)

    def output_a(self, dt_s: float, demand_a: float, room_a: float) -> float:
        """What it delivers `dt_s` after what it delivers now."""
        return min(demand_a, room_a, self.current_a + SOFT_START_A_PER_S * dt_s)

    def room_a(self, pack: Pack) -> float:
        """What the constant voltage leaves room for."""
        return max(self.cv_v - pack.ocv_v, 0.0) / (pack.series_ohm + self.lead_ohm)

    @property
    def demand_a(self) -> float:
        """What the output is set to before the voltage limits it."""
        return self._set_a() * self.gain

    def _set_a(self) -> float:
        if not self.running:
            return 0.0
        if self.mode is ChargeMode.CHARGE:
            return self.steps_a[self.current_step]
        if self.pulsing:
            return self.precharge_a if self.stage_s % (2 * PULSE_S) < PULSE_S else 0.0
        if self.mode is ChargeMode.PRECHARGE and self.precharge is Precharge.CONTINUOUS:
            return self.precharge_a
        return 0.0

    def _watch_taper(self, dt_s: float, *, tapering: bool) -> None:
        charging = self.running and self.mode is ChargeMode.CHARGE
        self.taper_s = self.taper_s + dt_s if charging and tapering and self.current_a < self.cutoff_a else 0.0
        if self.taper_s >= FULL_AFTER_S:
            self.full, self.current_a = True, 0.0

    def _next_stage(self, pack: Pack) -> None:
        """Automatic (rotary switch 2 … 5): search, recover, precharge, charge, and again when the pack has sunk."""
        cell_v = pack.ocv_v / pack.cells
        if self.full:
            if cell_v < automatic.RECHARGE_CELL_V:
                self.full, self.mode, self.stage_s = False, ChargeMode.BATTERY_SEARCH, 0.0
            return
        if self.mode is ChargeMode.BATTERY_SEARCH and (self.stage_s < automatic.SEARCH_S or self.resting):
            return
        stage, function = automatic.stage_for(cell_v)
        if stage is not self.mode:
            self.mode, self.precharge = stage, function
            self._begin()

    def _start_by_itself(self, dt_s: float) -> None:
        self.still_s = 0.0 if self.running else self.still_s + dt_s
        restless = self.restless_s is not None and self.still_s >= self.restless_s
        if restless or (self.rogue and self.still_s >= ROGUE_AFTER_S):
            self.rogue = self.resting = self.full = False
            self.run, self.mode = True, ChargeMode.CHARGE
            self._begin()

    def _go_back(self, dt_s: float) -> None:
        self.limit_s += dt_s
        if self.reverts_s is not None and self.limit_s >= self.reverts_s:
            self.current_step = len(self.steps_a) - 1
