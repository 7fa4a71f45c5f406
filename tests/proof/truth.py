"""The true state of an emulated bay, and what must follow from it: conditions with their budgets.

Nothing here uses the product's beliefs, except its state and alarm: a condition is a fact of the model or the wire.
While one holds and the charger runs, a stop must be written within its budget; and unless the charger then stops, the
bay must be UNCONTROLLABLE, with its alarm, 3 s later.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from orchestrator.core.rules import Rules
from orchestrator.core.states import ENERGISED
from orchestrator.model import STOP, Alarm, ChargeMode, Decision, State
from orchestrator.sim.charger_frames import Kind
from orchestrator.sim.pack import Readout
from tests.proof.virtual_rig import VirtualRig
from tests.proof.virtual_service import STEPS_A

#: "Device falls silent → stop byte"; a value read takes at most as long to be noticed.
SILENT_S = 2.0
#: "Stop not verified → UNCONTROLLABLE", and the time noticing it may take: a repetition and a poll.
VERIFY_S, MARGIN_S = 3.0, 0.7
#: Below the resolution of the BMU's values and of the charger's own.
ROUND_C, ROUND_V, ROUND_A = 0.1, 0.1, 0.2


@dataclass(slots=True)
class Heard:
    """The traffic on the lines, as seen by the emulated devices."""

    boot_s: float | None = None
    emergency_s: float | None = None
    stop_asked_s: float | None = None  #: the operator's stop or pause, not followed by a start
    stop_frame_s: float | None = None  #: the last stop frame written to the port
    started_s: float | None = None  #: when a frame switched the output on


@dataclass(slots=True)
class Bay:
    """One bay as it really is."""

    rig: VirtualRig
    rules: Rules
    decision: Decision
    now_s: float
    heard: Heard
    told: Readout = field(init=False)

    def __post_init__(self) -> None:
        self.told = self.rig.bay.readout()

    @property
    def runs(self) -> bool:
        charger = self.rig.bay.charger
        return charger.running or charger.current_a > 0.5


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition under which no charger may run for longer than `within_s`."""

    name: str
    within_s: float
    holds: Callable[[Bay], bool]


def _shown(bay: Bay, kind: Kind, truth: float) -> float:
    """The charger's reported value: its lie shows only in comparison with the BMU's values."""
    return bay.rig.wire.lies[kind] / 100 if kind in bay.rig.wire.lies else truth


def _implausible(bay: Bay) -> bool:
    return not 0 <= bay.told.soc_pct <= 100


def _over_voltage(bay: Bay) -> bool:
    return max(bay.told.voltage_v, _shown(bay, Kind.VOLTAGE, bay.rig.bay.charger.voltage_v)) > bay.rules.max_v + ROUND_V


def _switch_turned(bay: Bay) -> bool:
    return bay.rig.bay.charger.control_mode is not bay.rig.as_built.control_mode


def _over_current(bay: Bay) -> bool:
    charger = bay.rig.bay.charger
    limit_a = bay.rules.bay.limits.current_a
    if bay.rules.manual:
        limit_a = min(limit_a, STEPS_A[charger.current_step])
    return _shown(bay, Kind.CURRENT, charger.current_a) > limit_a * 1.1 + 0.3 + ROUND_A


def _volts_disagree(bay: Bay) -> bool:
    differ_v = abs(_shown(bay, Kind.VOLTAGE, bay.rig.bay.charger.voltage_v) - bay.told.voltage_v)
    return differ_v > max(1.0, 0.02 * bay.told.voltage_v) + ROUND_V


def _pulses(bay: Bay) -> bool:
    return bay.rig.bay.charger.mode in (ChargeMode.PRECHARGE, ChargeMode.BATTERY_RECOVERY)


def _amps_disagree(bay: Bay) -> bool:
    charger_a = _shown(bay, Kind.CURRENT, bay.rig.bay.charger.current_a)
    return abs(charger_a - bay.told.current_a) > max(1.0, 0.1 * charger_a) + ROUND_A


def _since_start(when_s: float | None, bay: Bay) -> bool:
    """It happened after the output was switched on."""
    return when_s is not None and bay.heard.started_s is not None and when_s > bay.heard.started_s + 0.5


TRIP_BITS = 1 << 0 | 1 << 2 | 1 << 4 | 1 << 6

CONDITIONS: tuple[Condition, ...] = (
    Condition("polarity", SILENT_S, lambda b: b.rig.wire.lies.get(Kind.CHARGE_MODE) == ChargeMode.REVERSED),
    Condition("runs uncommanded", SILENT_S, lambda b: b.decision.state not in ENERGISED),
    Condition("charger's answers lost", SILENT_S, lambda b: b.rig.wire.mute_tx or b.rig.wire.complains),
    Condition("charger hears nothing", SILENT_S, lambda b: b.rig.wire.mute_rx and b.rig.wire.mute_tx),
    Condition("port gone", SILENT_S, lambda b: not b.rig.tty.present or b.rig.tty.stalled),
    Condition("BMU silent", SILENT_S, lambda b: b.rig.bmu.port.faults.mute),
    Condition("BMU's answers too late", SILENT_S + 0.5, lambda b: b.rig.bmu.port.faults.delay_s > 0.3),
    Condition("temperature refused", SILENT_S + 0.5, lambda b: bool(b.rig.bmu.port.faults.aborts)),
    Condition("temperature of the wrong size", SILENT_S, lambda b: bool(b.rig.bmu.port.faults.short)),
    Condition("hot", SILENT_S, lambda b: b.told.temperature_c >= b.rules.temperature_c.high + ROUND_C),
    Condition("cold", SILENT_S, lambda b: b.told.temperature_c < b.rules.temperature_c.low - ROUND_C),
    Condition("over-voltage", SILENT_S, _over_voltage),
    Condition("over-current", SILENT_S, _over_current),
    Condition("implausible SOC", SILENT_S + 1.0, _implausible),
    Condition("status word", SILENT_S, lambda b: bool(int(b.told.status) & TRIP_BITS)),
    Condition("volts disagree", SILENT_S + 3.0, lambda b: not _pulses(b) and _volts_disagree(b)),
    # Pulses move both values faster than the BMU is read: there the means of the last 10 s are compared.
    Condition("volts disagree in pulses", SILENT_S + 3.0 + 10.0, lambda b: _pulses(b) and _volts_disagree(b)),
    Condition("amps disagree", SILENT_S + 5.0, _amps_disagree),
    Condition("no battery", SILENT_S, lambda b: not b.rig.bay.connected),
    Condition("undocumented mode", SILENT_S, lambda b: not 1 <= b.rig.wire.lies.get(Kind.CHARGE_MODE, 1) <= 8),
    Condition("rotary switch turned", SILENT_S, _switch_turned),
    Condition("BMU booted", SILENT_S, lambda b: _since_start(b.heard.boot_s, b)),
    Condition("emergency", SILENT_S, lambda b: _since_start(b.heard.emergency_s, b)),
    Condition("operator's stop", 0.5, lambda b: b.heard.stop_asked_s is not None),
)  # fmt: skip


def named(bay: Bay) -> bool:
    """This charger is reported as out of control.

    UNCONTROLLABLE, with its alarm; or last seen at rest (or never), silent since then, and being stopped.
    """
    decision = bay.decision
    if decision.state is State.UNCONTROLLABLE:
        return decision.alarm is Alarm.DANGER
    return decision.state in (State.OFFLINE, State.TRIPPED) and decision.command == STOP
