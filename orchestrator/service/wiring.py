"""Creates what a bay may have besides charger and BMU: a contactor, and an earlier run's charger on another port."""

from collections.abc import Callable
from functools import partial

from orchestrator.config.station import BayConfig, ChargerConfig, Limits
from orchestrator.devices.charger import ChargerPort
from orchestrator.keys import Range
from orchestrator.link.gpio import OutputLine, need_gpiod
from orchestrator.service.contactor import Contactor
from orchestrator.service.guarded import GuardedOutput, GuardianLink
from orchestrator.service.past import Place
from orchestrator.service.ports import charger_port


def stray_port(guardian: GuardianLink, poke: Callable[[], None], place: Place) -> ChargerPort:
    """A port that is only ever stopped: its limits allow no current."""
    charger = ChargerConfig(port=place.port, control=place.control, steps_a=(0.0,) * 5, rs485=place.rs485)
    return charger_port(charger, Limits(voltage_v=0.0, current_a=0.0, temperature_c=Range(0, 0)), poke, guardian)


def open_contactor(bay: BayConfig, guardian: GuardianLink) -> Contactor | None:
    """The bay's contactor, if it has one. LinkError if its library is not installed."""
    config = bay.contactor
    if config is None:
        return None
    need_gpiod()
    open_output = partial(OutputLine.open, config.chip, config.line, active_low=config.active_low)
    return Contactor(partial(GuardedOutput, bay.name, open_output, guardian))
