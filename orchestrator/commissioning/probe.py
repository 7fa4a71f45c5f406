"""`orchestrator probe`: queries each device of a station and shows everything that it reports.

For the first day at a new station: is it wired correctly, does it answer, which object map is right? It sends no
commands: the charger receives status requests, the BMU reads (and an NMT command, on request).
"""

from collections.abc import Callable, Sequence
from textwrap import indent
from time import monotonic

from orchestrator.commissioning.probe_bmu import BmuProbe
from orchestrator.config.station import BayConfig, ChargerConfig, ContactorConfig, Rs485, Station
from orchestrator.devices.dialogue import REQUESTS, SILENCE, Dialogue
from orchestrator.devices.poll import poll
from orchestrator.errors import LinkError, ServiceError
from orchestrator.link.can import CanBus
from orchestrator.link.gpio import describe
from orchestrator.link.serial import SerialLine
from orchestrator.model import Cause
from orchestrator.protocol.explain import explain
from orchestrator.protocol.hextext import hex_of
from orchestrator.protocol.sdo import NmtCommand
from orchestrator.service.socketfile import is_alive
from orchestrator.text.catalogue import say

NMT = {
    "start": NmtCommand.START,
    "stop": NmtCommand.STOP,
    "reset-node": NmtCommand.RESET_NODE,
    "reset-communication": NmtCommand.RESET_COMMUNICATION,
}

Show = Callable[[str], None]


def probe(
    station: Station, bays: Sequence[str], nmt: str | None = None, *, old_protocol: bool = False, show: Show = print
) -> int:
    """Probe the named bays, or all; 0 if every device answered, else 1.

    `nmt` (a key of `NMT`) is sent to each BMU first. `old_protocol`: also request the BMU's undocumented pages.
    ServiceError if a service is running this station, or for an unknown bay.
    """
    known = {bay.name: bay for bay in station.bays}
    unknown = [name for name in bays if name not in known]
    if unknown:
        raise ServiceError(f"no bay {unknown[0]!r} in this station: {', '.join(known)}")
    if is_alive(station.control.socket):
        raise ServiceError(
            f"a service is running this station ({station.control.socket}), and two cannot talk to one device: "
            "stop it first, or ask it: orchestrator status"
        )
    silent = []
    for bay in [known[name] for name in bays] or station.bays:
        show(f"=== {bay.name}")
        if not _charger(bay.charger, show):
            silent.append(f"{bay.name}'s charger")
        if bay.contactor is not None and not _contactor(bay.contactor, show):
            silent.append(f"{bay.name}'s contactor")
        if not _bmu(station, bay, NMT[nmt] if nmt else None, old_protocol=old_protocol, show=show):
            silent.append(f"{bay.name}'s BMU")
    show(f"NO ANSWER: {', '.join(silent)}" if silent else "every device answered")
    return 1 if silent else 0


# --- the charger -----------------------------------------------------------------------------------------------------


def _charger(config: ChargerConfig, show: Show) -> bool:
    try:
        line = SerialLine.open(config.port, kernel_rs485=config.rs485 is Rs485.KERNEL)
    except LinkError as error:
        show(f"charger: {say(error.cause)}")
        return False
    dialogue = Dialogue()
    try:
        if stranger := line.locked_by():
            show(f"charger on {config.port}: {say(stranger)} has locked this port, and may take its answers")
        for _ in REQUESTS:
            reading, exchange = poll(line, dialogue, monotonic)
            if reading is not None:
                break
    except LinkError as error:
        show(f"charger: {say(error.cause)}")
        return False
    finally:
        line.close()
    if reading is None:
        show(f"charger on {say(Cause.of(SILENCE[dialogue.heard], port=config.port))}")
    else:
        show(f"charger on {config.port}: answers")
    show(indent("\n".join(item.text for item in explain(hex_of(exchange))), "  "))
    if reading is not None and reading.control_mode not in (None, config.control):
        words = [mode.name.lower() if mode is not None else "" for mode in (reading.control_mode, config.control)]
        show(f"  ! it is in {words[0]} mode, the station file says {words[1]}: look at its rotary switch")
    return reading is not None


# --- the contactor ---------------------------------------------------------------------------------------------------


def _contactor(config: ContactorConfig, show: Show) -> bool:
    try:
        closes = "low" if config.active_low else "high"
        show(f"contactor on {describe(config.chip, config.line)}; closed while the pin is {closes}")
    except LinkError as error:
        show(f"contactor: {say(error.cause)}")
        return False
    return True


# --- the BMU ---------------------------------------------------------------------------------------------------------


def _bmu(station: Station, bay: BayConfig, nmt: NmtCommand | None, *, old_protocol: bool, show: Show) -> bool:
    name = bay.battery.can
    bus = CanBus(name, station.can[name], [bay.battery.node_id], pages=old_protocol, filtered=False)
    bmu = BmuProbe(bus, bay.battery, show)
    try:
        bus.open()
        return bmu.run(nmt, old_protocol=old_protocol)
    except LinkError as error:
        show(f"BMU: {say(error.cause)}")
        return False
    finally:
        bus.close()
