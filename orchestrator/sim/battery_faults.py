"""What goes wrong with an emulated battery: its pack, and what its BMU says of it."""

from typing import TYPE_CHECKING

from orchestrator.sim.pack import DRIVEN_K

if TYPE_CHECKING:
    from orchestrator.sim.rig import Rig  # it needs durand, and the names of faults do not

#: SDO abort: "object does not exist in the object dictionary".
NO_SUCH_OBJECT = 0x0602_0000
#: The object that holds the temperature, without which nothing may be charged.
TEMPERATURE = 0x6004
#: How long a BMU is not heard while somebody puts another battery in its place.
EXCHANGE_S = 4.0


def bmu_silent(rig: "Rig", _: float | None) -> None:
    """The BMU falls silent."""
    rig.bmu.port.faults.mute = True


def sdo_abort(rig: "Rig", value: float | None) -> None:
    """The BMU refuses to tell the temperature."""
    rig.bmu.port.faults.aborts[TEMPERATURE] = NO_SUCH_OBJECT if value is None else int(value)


def wrong_size(rig: "Rig", _: float | None) -> None:
    """The BMU tells the temperature in the wrong size."""
    rig.bmu.port.faults.short.add(TEMPERATURE)


def implausible_soc(rig: "Rig", value: float | None) -> None:
    """The BMU says 140 % state of charge."""
    rig.bay.falsify["soc_pct"] = lambda _: 140.0 if value is None else value


def stale_reading(rig: "Rig", value: float | None) -> None:
    """The BMU's answers come 2 s late."""
    rig.bmu.port.faults.delay_s = 2.0 if value is None else value


def frozen_temperature(rig: "Rig", _: float | None) -> None:
    """The BMU goes on saying the temperature of now."""
    frozen_c = rig.bay.pack.temperature_c
    rig.bay.falsify["temperature_c"] = lambda _: frozen_c


def over_temperature(rig: "Rig", value: float | None) -> None:
    """The pack heats up to 48 °C, 2 K at once and 3 K in each second."""
    _drive_temperature(rig, 48.0 if value is None else value)


def under_temperature(rig: "Rig", value: float | None) -> None:
    """The pack cools down to −5 °C, 2 K at once and 3 K in each second."""
    _drive_temperature(rig, -5.0 if value is None else value)


def _drive_temperature(rig: "Rig", target_c: float) -> None:
    """The first step is there at once, the rest comes as fast as a pack's temperature can change."""
    pack = rig.bay.pack
    pack.driven_c = target_c
    pack.temperature_c += min(max(target_c - pack.temperature_c, -DRIVEN_K), DRIVEN_K)


def temperature_jump(rig: "Rig", value: float | None) -> None:
    """The BMU says 15 K more from one reading to the next."""
    rig.bay.falsify["temperature_c"] = lambda celsius: celsius + (15.0 if value is None else value)


def over_voltage(rig: "Rig", value: float | None) -> None:
    """The pack's voltage rises 4 V above the charger's end of charge."""
    charger, pack = rig.bay.charger, rig.bay.pack
    target_v = charger.cv_v + 4.0 if value is None else value
    pack.bias_v += target_v - pack.ocv_v


def volts_disagree(rig: "Rig", value: float | None) -> None:
    """The BMU says 3 V less than the charger."""
    offset_v = -3.0 if value is None else value
    rig.bay.falsify["voltage_v"] = lambda volts: volts + offset_v


def amps_disagree(rig: "Rig", value: float | None) -> None:
    """The BMU says 3 A more than the charger."""
    offset_a = 3.0 if value is None else value
    rig.bay.falsify["current_a"] = lambda amps: amps + offset_a


def status_bits(rig: "Rig", value: float | None) -> None:
    """The BMU says: BMU error (status bit 6)."""
    bits = 1 << 6 if value is None else int(value)
    rig.bay.falsify["status"] = lambda status: int(status) | bits


def emergency(rig: "Rig", value: float | None) -> None:
    """The BMU sends an emergency frame."""
    rig.bmu.emergency(0x5000 if value is None else int(value))


def precharge_no_rise(rig: "Rig", _: float | None) -> None:
    """What flows into the pack is lost inside: its voltage stays."""
    rig.bay.pack.leaky = True


def bmu_reboot(rig: "Rig", _: float | None) -> None:
    """The BMU restarts and forgets its settings."""
    rig.bmu.reboot()


def soc_jump(rig: "Rig", value: float | None) -> None:
    """The BMU says 15 % less from one reading to the next."""
    step_pct = -15.0 if value is None else value
    rig.bay.falsify["soc_pct"] = lambda pct: min(max(pct + step_pct, 0.0), 100.0)


def battery_exchanged(rig: "Rig", value: float | None) -> None:
    """The BMU falls silent, and after 4 s says 25 % less."""
    soc_jump(rig, -25.0 if value is None else value)
    rig.bmu.port.faults.mute = True
    rig.later(EXCHANGE_S, lambda: setattr(rig.bmu.port.faults, "mute", False))


def battery_removed(rig: "Rig", _: float | None) -> None:
    """The battery is taken out of the bay."""
    rig.bay.connected = False
    rig.bmu.port.faults.mute = True
