"""What goes wrong with an emulated charger, its line and its port."""

from typing import TYPE_CHECKING

from orchestrator.model import ChargeMode, ControlMode
from orchestrator.sim.charger import Push
from orchestrator.sim.charger_frames import Kind

if TYPE_CHECKING:
    from orchestrator.sim.rig import Rig  # it needs durand, and the names of faults do not


def reverse_polarity(rig: "Rig", _: float | None) -> None:
    """The charger says that the battery is connected the wrong way round."""
    rig.bay.charger.reversed = True


def error_stop(rig: "Rig", _: float | None) -> None:
    """The charger stops by itself and says: error stop (mode 8)."""
    rig.bay.charger.halted = ChargeMode.ERROR_STOP


def system_stop(rig: "Rig", _: float | None) -> None:
    """The charger stops by itself and says: system stop (mode 7)."""
    rig.bay.charger.halted = ChargeMode.SYSTEM_STOP


def charger_silent(rig: "Rig", _: float | None) -> None:
    """The charger's answers no longer come through; it still hears."""
    rig.wire.mute_tx = True


def charger_cut_off(rig: "Rig", _: float | None) -> None:
    """The cable to the charger is cut: it neither hears nor answers."""
    rig.wire.mute_rx = rig.wire.mute_tx = True


def charger_error_frames(rig: "Rig", _: float | None) -> None:
    """The charger answers every frame with a checksum error."""
    rig.wire.complains = True


def over_current(rig: "Rig", value: float | None) -> None:
    """The charger delivers half as much again as its limit."""
    charger = rig.bay.charger
    charger.gain = 1.5 if value is None else value
    charger.current_a *= charger.gain  # no soft start: it is there at once


def rogue_run(rig: "Rig", _: float | None) -> None:
    """The charger starts by itself after standing still for 2 s."""
    rig.bay.charger.rogue = True


def command_ignored(rig: "Rig", _: float | None) -> None:
    """The charger falls to its lowest limit and takes no other."""
    charger = rig.bay.charger
    charger.deaf_to.add(Push.CURRENT_LIMIT)
    charger.current_step = 0


def ignore_stop(rig: "Rig", _: float | None) -> None:
    """The charger no longer obeys a stop."""
    rig.bay.charger.ignores_stop = True


def illegal_value(rig: "Rig", value: float | None) -> None:
    """The charger says mode 9, which does not exist."""
    rig.wire.lies[Kind.CHARGE_MODE] = 9 if value is None else int(value)


def polarity_contradicts(rig: "Rig", _: float | None) -> None:
    """The charger says mode 6 (reversed) and connection 1 (normal)."""
    rig.wire.lies[Kind.CHARGE_MODE] = ChargeMode.REVERSED


def frozen_charger(rig: "Rig", _: float | None) -> None:
    """The charger goes on saying the volts and amps of now."""
    charger = rig.bay.charger
    rig.wire.lies |= {Kind.VOLTAGE: round(charger.voltage_v * 100), Kind.CURRENT: round(charger.current_a * 100)}


def mode_taken_over(rig: "Rig", _: float | None) -> None:
    """Somebody turns the charger's rotary switch to automatic."""
    rig.bay.charger.control_mode = ControlMode.AUTOMATIC


def port_gone(rig: "Rig", _: float | None) -> None:
    """The serial adapter is unplugged."""
    rig.wire.close()
