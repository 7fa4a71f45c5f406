"""Creates what a station has besides its bays' devices: buses, contactors, an earlier run's charger on another port."""

from collections.abc import Callable
from functools import partial
from time import time

from orchestrator.config.station import BayConfig, ChargerConfig, JournalConfig, Limits, Station
from orchestrator.devices.charger import ChargerPort
from orchestrator.keys import Range
from orchestrator.link.can import CanBus
from orchestrator.link.gpio import OutputLine, need_gpiod
from orchestrator.model import Cause
from orchestrator.service.contactor import Contactor
from orchestrator.service.guarded import GuardedOutput, GuardianLink
from orchestrator.service.past import Place
from orchestrator.service.ports import charger_port
from orchestrator.service.recorder import Recorder


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


def can_buses(station: Station) -> dict[str, CanBus]:
    """The station's CAN buses by name, each with the ids of its BMUs; none of them is open yet."""
    ids = {name: [bay.battery.node_id for bay in station.bays if bay.battery.can == name] for name in station.can}
    return {name: CanBus(name, settings, ids[name]) for name, settings in station.can.items()}


def recorder(kept: JournalConfig, boot: str, say: Callable[[Cause], None]) -> Recorder:
    """What writes the record of charges, beside the journal."""
    return Recorder(kept.directory, kept.sessions_years, time, say, boot=boot, curves_days=kept.curves_days)
