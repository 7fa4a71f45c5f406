"""The faults that can be injected into an emulated bay, by name: a sentence for people and what happens.

`value` is the optional number that some take (a temperature, a delay). `heal` takes every one of them away; what the
charger did because of them, and what the pack has become, stays.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

from orchestrator.sim import battery_faults, charger_faults, hostile
from orchestrator.sim.can_wire import NodeFaults

if TYPE_CHECKING:
    from orchestrator.sim.rig import Rig  # it needs durand, and the names of faults do not


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: what it is in words, and what it does to a rig; `value` None means its usual strength."""

    about: str
    happen: "Callable[[Rig, float | None], None]"


def _heal(rig: "Rig", _: float | None) -> None:
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
    "reverse_polarity": Fault(
        "the charger says that the battery is connected the wrong way round", charger_faults.reverse_polarity
    ),
    "error_stop": Fault("the charger stops by itself and says: error stop (mode 8)", charger_faults.error_stop),
    "system_stop": Fault("the charger stops by itself and says: system stop (mode 7)", charger_faults.system_stop),
    "charger_silent": Fault(
        "the charger's answers no longer come through; it still hears", charger_faults.charger_silent
    ),
    "charger_cut_off": Fault(
        "the cable to the charger is cut: it neither hears nor answers", charger_faults.charger_cut_off
    ),
    "charger_error_frames": Fault(
        "the charger answers every frame with a checksum error", charger_faults.charger_error_frames
    ),
    "bmu_silent": Fault("the BMU falls silent", battery_faults.bmu_silent),
    "sdo_abort": Fault("the BMU refuses to tell the temperature", battery_faults.sdo_abort),
    "wrong_size": Fault("the BMU tells the temperature in the wrong size", battery_faults.wrong_size),
    "implausible_soc": Fault("the BMU says 140 % state of charge", battery_faults.implausible_soc),
    "stale_reading": Fault("the BMU's answers come 2 s late", battery_faults.stale_reading),
    "temperature_jump": Fault("the BMU says 15 K more from one reading to the next", battery_faults.temperature_jump),
    "frozen_temperature": Fault("the BMU goes on saying the temperature of now", battery_faults.frozen_temperature),
    "over_temperature": Fault(
        "the pack heats up to 48 °C, 2 K at once and 3 K in each second", battery_faults.over_temperature
    ),
    "under_temperature": Fault(
        "the pack cools down to −5 °C, 2 K at once and 3 K in each second", battery_faults.under_temperature
    ),
    "over_voltage": Fault(
        "the pack's voltage rises 4 V above the charger's end of charge", battery_faults.over_voltage
    ),
    "over_current": Fault("the charger delivers half as much again as its limit", charger_faults.over_current),
    "volts_disagree": Fault("the BMU says 3 V less than the charger", battery_faults.volts_disagree),
    "amps_disagree": Fault("the BMU says 3 A more than the charger", battery_faults.amps_disagree),
    "status_bits": Fault("the BMU says: BMU error (status bit 6)", battery_faults.status_bits),
    "emergency": Fault("the BMU sends an emergency frame", battery_faults.emergency),
    "rogue_run": Fault("the charger starts by itself after standing still for 2 s", charger_faults.rogue_run),
    "command_ignored": Fault(
        "the charger falls to its lowest limit and takes no other", charger_faults.command_ignored
    ),
    "precharge_no_rise": Fault(
        "what flows into the pack is lost inside: its voltage stays", battery_faults.precharge_no_rise
    ),
    "illegal_value": Fault("the charger says mode 9, which does not exist", charger_faults.illegal_value),
    "polarity_contradicts": Fault(
        "the charger says mode 6 (reversed) and connection 1 (normal)", charger_faults.polarity_contradicts
    ),
    "frozen_charger": Fault("the charger goes on saying the volts and amps of now", charger_faults.frozen_charger),
    "soc_jump": Fault("the BMU says 15 % less from one reading to the next", battery_faults.soc_jump),
    "battery_exchanged": Fault("the BMU falls silent, and after 4 s says 25 % less", battery_faults.battery_exchanged),
    "mode_taken_over": Fault("somebody turns the charger's rotary switch to automatic", charger_faults.mode_taken_over),
    "battery_removed": Fault("the battery is taken out of the bay", battery_faults.battery_removed),
    "ignore_stop": Fault("the charger no longer obeys a stop", charger_faults.ignore_stop),
    "bmu_reboot": Fault("the BMU restarts and forgets its settings", battery_faults.bmu_reboot),
    "port_gone": Fault("the serial adapter is unplugged", charger_faults.port_gone),
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
