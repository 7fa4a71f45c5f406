"""The faults that can be injected into an emulated bay, by name: a sentence for people and what happens.

`value` is the optional number that some take (a temperature, a delay). `heal` takes every one of them away; what the
charger did because of them, and what the pack has become, stays.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from orchestrator.model import ChargeMode, ControlMode
from orchestrator.sim import hostile
from orchestrator.sim.can_wire import NodeFaults
from orchestrator.sim.charger import Push
from orchestrator.sim.charger_frames import Kind
from orchestrator.sim.pack import DRIVEN_K_PER_S
from orchestrator.sim.rig import Rig

#: SDO abort: "object does not exist in the object dictionary".
NO_SUCH_OBJECT = 0x0602_0000
#: The object that holds the temperature, without which nothing may be charged.
TEMPERATURE = 0x6004
#: How long a BMU is not heard while somebody puts another battery in its place.
EXCHANGE_S = 4.0


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: what it is in words, and what it does to a rig; `value` None means its usual strength."""

    about: str
    happen: Callable[[Rig, float | None], None]


def _reverse_polarity(rig: Rig, _: float | None) -> None:
    rig.bay.charger.reversed = True


def _error_stop(rig: Rig, _: float | None) -> None:
    rig.bay.charger.halted = ChargeMode.ERROR_STOP


def _system_stop(rig: Rig, _: float | None) -> None:
    rig.bay.charger.halted = ChargeMode.SYSTEM_STOP


def _charger_silent(rig: Rig, _: float | None) -> None:
    rig.wire.mute_tx = True


def _charger_cut_off(rig: Rig, _: float | None) -> None:
    rig.wire.mute_rx = rig.wire.mute_tx = True


def _charger_error_frames(rig: Rig, _: float | None) -> None:
    rig.wire.complains = True


def _bmu_silent(rig: Rig, _: float | None) -> None:
    rig.bmu.port.faults.mute = True


def _sdo_abort(rig: Rig, value: float | None) -> None:
    rig.bmu.port.faults.aborts[TEMPERATURE] = NO_SUCH_OBJECT if value is None else int(value)


def _wrong_size(rig: Rig, _: float | None) -> None:
    rig.bmu.port.faults.short.add(TEMPERATURE)


def _implausible_soc(rig: Rig, value: float | None) -> None:
    rig.bay.falsify["soc_pct"] = lambda _: 140.0 if value is None else value


def _stale_reading(rig: Rig, value: float | None) -> None:
    rig.bmu.port.faults.delay_s = 2.0 if value is None else value


def _frozen_temperature(rig: Rig, _: float | None) -> None:
    frozen_c = rig.bay.pack.temperature_c
    rig.bay.falsify["temperature_c"] = lambda _: frozen_c


def _over_temperature(rig: Rig, value: float | None) -> None:
    _drive_temperature(rig, 48.0 if value is None else value)


def _under_temperature(rig: Rig, value: float | None) -> None:
    _drive_temperature(rig, -5.0 if value is None else value)


def _drive_temperature(rig: Rig, target_c: float) -> None:
    """The first step is there at once, the rest comes as fast as a pack's temperature can change."""
    pack = rig.bay.pack
    pack.driven_c = target_c
    pack.temperature_c += min(max(target_c - pack.temperature_c, -DRIVEN_K_PER_S), DRIVEN_K_PER_S)


def _temperature_jump(rig: Rig, value: float | None) -> None:
    rig.bay.falsify["temperature_c"] = lambda celsius: celsius + (15.0 if value is None else value)


def _over_voltage(rig: Rig, value: float | None) -> None:
    charger, pack = rig.bay.charger, rig.bay.pack
    target_v = charger.cv_v + 4.0 if value is None else value
    pack.bias_v += target_v - pack.ocv_v


def _over_current(rig: Rig, value: float | None) -> None:
    charger = rig.bay.charger
    charger.gain = 1.5 if value is None else value
    charger.current_a *= charger.gain  # no soft start: it is there at once


def _volts_disagree(rig: Rig, value: float | None) -> None:
    offset_v = -3.0 if value is None else value
    rig.bay.falsify["voltage_v"] = lambda volts: volts + offset_v


def _amps_disagree(rig: Rig, value: float | None) -> None:
    offset_a = 3.0 if value is None else value
    rig.bay.falsify["current_a"] = lambda amps: amps + offset_a


def _status_bits(rig: Rig, value: float | None) -> None:
    bits = 1 << 6 if value is None else int(value)
    rig.bay.falsify["status"] = lambda status: int(status) | bits


def _emergency(rig: Rig, value: float | None) -> None:
    rig.bmu.emergency(0x5000 if value is None else int(value))


def _rogue_run(rig: Rig, _: float | None) -> None:
    rig.bay.charger.rogue = True


def _command_ignored(rig: Rig, _: float | None) -> None:
    charger = rig.bay.charger
    charger.deaf_to.add(Push.CURRENT_LIMIT)
    charger.current_limit = 0


def _precharge_no_rise(rig: Rig, _: float | None) -> None:
    rig.bay.pack.leaky = True


def _ignore_stop(rig: Rig, _: float | None) -> None:
    rig.bay.charger.ignores_stop = True


def _bmu_reboot(rig: Rig, _: float | None) -> None:
    rig.bmu.reboot()


def _illegal_value(rig: Rig, value: float | None) -> None:
    rig.wire.lies[Kind.CHARGE_MODE] = 9 if value is None else int(value)


def _polarity_contradicts(rig: Rig, _: float | None) -> None:
    rig.wire.lies[Kind.CHARGE_MODE] = ChargeMode.REVERSED


def _frozen_charger(rig: Rig, _: float | None) -> None:
    charger = rig.bay.charger
    rig.wire.lies |= {Kind.VOLTAGE: round(charger.voltage_v * 100), Kind.CURRENT: round(charger.current_a * 100)}


def _soc_jump(rig: Rig, value: float | None) -> None:
    step_pct = -15.0 if value is None else value
    rig.bay.falsify["soc_pct"] = lambda pct: min(max(pct + step_pct, 0.0), 100.0)


def _battery_exchanged(rig: Rig, value: float | None) -> None:
    _soc_jump(rig, -25.0 if value is None else value)
    rig.bmu.port.faults.mute = True
    rig.later(EXCHANGE_S, lambda: setattr(rig.bmu.port.faults, "mute", False))


def _mode_taken_over(rig: Rig, _: float | None) -> None:
    rig.bay.charger.control_mode = ControlMode.AUTOMATIC


def _battery_removed(rig: Rig, _: float | None) -> None:
    rig.bay.connected = False
    rig.bmu.port.faults.mute = True


def _port_gone(rig: Rig, _: float | None) -> None:
    rig.wire.close()


def _heal(rig: Rig, _: float | None) -> None:
    charger, pack = rig.bay.charger, rig.bay.pack
    charger.reversed = charger.rogue = charger.ignores_stop = False
    charger.halted, charger.gain, charger.control_mode = None, 1.0, rig.as_built.control_mode
    charger.deaf_to.clear()
    charger.stops_left, charger.restless_s, charger.reverts_s = inf, None, None
    pack.cells = rig.as_built.cells
    pack.bias_v, pack.leaky = 0.0, False
    if pack.driven_c is not None:
        pack.driven_c = rig.as_built.ambient_c
    rig.bay.falsify.clear()
    rig.bay.connected = True
    rig.wire.lies.clear()
    rig.wire.liars.clear()
    rig.wire.unlock()
    rig.wire.mute_rx = rig.wire.mute_tx = rig.wire.complains = False
    rig.bmu.port.faults = NodeFaults()
    if not rig.wire.is_open:
        rig.wire.open()


FAULTS = {
    "reverse_polarity": Fault("the charger says that the battery is connected the wrong way round", _reverse_polarity),
    "error_stop": Fault("the charger stops by itself and says: error stop (mode 8)", _error_stop),
    "system_stop": Fault("the charger stops by itself and says: system stop (mode 7)", _system_stop),
    "charger_silent": Fault("the charger's answers no longer come through; it still hears", _charger_silent),
    "charger_cut_off": Fault("the cable to the charger is cut: it neither hears nor answers", _charger_cut_off),
    "charger_error_frames": Fault("the charger answers every frame with a checksum error", _charger_error_frames),
    "bmu_silent": Fault("the BMU falls silent", _bmu_silent),
    "sdo_abort": Fault("the BMU refuses to tell the temperature", _sdo_abort),
    "wrong_size": Fault("the BMU tells the temperature in the wrong size", _wrong_size),
    "implausible_soc": Fault("the BMU says 140 % state of charge", _implausible_soc),
    "stale_reading": Fault("the BMU's answers come 2 s late", _stale_reading),
    "temperature_jump": Fault("the BMU says 15 K more from one reading to the next", _temperature_jump),
    "frozen_temperature": Fault("the BMU goes on saying the temperature of now", _frozen_temperature),
    "over_temperature": Fault("the pack heats up to 48 °C, 4 K at once and 4 K in each second", _over_temperature),
    "under_temperature": Fault("the pack cools down to −5 °C, 4 K at once and 4 K in each second", _under_temperature),
    "over_voltage": Fault("the pack's voltage rises 4 V above the charger's end of charge", _over_voltage),
    "over_current": Fault("the charger delivers half as much again as its limit", _over_current),
    "volts_disagree": Fault("the BMU says 3 V less than the charger", _volts_disagree),
    "amps_disagree": Fault("the BMU says 3 A more than the charger", _amps_disagree),
    "status_bits": Fault("the BMU says: BMU error (status bit 6)", _status_bits),
    "emergency": Fault("the BMU sends an emergency frame", _emergency),
    "rogue_run": Fault("the charger starts by itself after standing still for 2 s", _rogue_run),
    "command_ignored": Fault("the charger falls to its lowest limit and takes no other", _command_ignored),
    "precharge_no_rise": Fault("what flows into the pack is lost inside: its voltage stays", _precharge_no_rise),
    "illegal_value": Fault("the charger says mode 9, which does not exist", _illegal_value),
    "polarity_contradicts": Fault(
        "the charger says mode 6 (reversed) and connection 1 (normal)", _polarity_contradicts
    ),
    "frozen_charger": Fault("the charger goes on saying the volts and amps of now", _frozen_charger),
    "soc_jump": Fault("the BMU says 15 % less from one reading to the next", _soc_jump),
    "battery_exchanged": Fault("the BMU falls silent, and after 4 s says 25 % less", _battery_exchanged),
    "mode_taken_over": Fault("somebody turns the charger's rotary switch to automatic", _mode_taken_over),
    "battery_removed": Fault("the battery is taken out of the bay", _battery_removed),
    "ignore_stop": Fault("the charger no longer obeys a stop", _ignore_stop),
    "bmu_reboot": Fault("the BMU restarts and forgets its settings", _bmu_reboot),
    "port_gone": Fault("the serial adapter is unplugged", _port_gone),
    "line_taken_over": Fault("another program sets the serial port to 115200 baud", hostile.line_taken_over),
    "port_locked": Fault("another program locks the serial port as soon as it is free", hostile.port_locked),
    "says_standby": Fault("the charger says that it stands by with 0.00 A, whatever it does", hostile.says_standby),
    "says_standby_now_and_then": Fault(
        "every second answer of the charger says that it stands by with 0.00 A", hostile.says_standby_now_and_then
    ),
    "limit_reverts": Fault(
        "the charger takes each limit and goes back to its highest after 0.25 s", hostile.limit_reverts
    ),
    "runs_again": Fault("the charger runs again by itself, 3 s after each stop", hostile.runs_again),
    "obeys_once": Fault("the charger obeys one more stop, and no later one", hostile.obeys_once),
    "stopped_elsewhere": Fault("somebody else sends the charger to standby", hostile.stopped_elsewhere),
    "bmu_frozen": Fault("the BMU goes on saying all values of now", hostile.bmu_frozen),
    "pack_collapsed": Fault("the pack's voltage falls to 31 V at once", hostile.pack_collapsed),
    "another_pack": Fault(
        "the pack is one of 10 cells in series (36 V), with a BMU like the other's", hostile.another_pack
    ),
    "heal": Fault("all faults are gone, the adapter is plugged in again", _heal),
}
