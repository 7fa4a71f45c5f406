"""`orchestrator probe`: queries each device of a station and shows everything that it reports.

For the first day at a new station: is it wired correctly, does it answer, which object map is right? It sends no
commands: the charger receives status requests, the BMU reads (and an NMT command, on request). Each node id that the
switch of a BMU can set is read once as well.
"""

from collections.abc import Callable, Sequence
from textwrap import indent
from time import monotonic

from orchestrator.commissioning.nodes import listed, nodes_on
from orchestrator.commissioning.probe_bmu import BmuProbe
from orchestrator.commissioning.volts import Volts, compared, swapped
from orchestrator.config.amperes import volts_differ
from orchestrator.config.station import BayConfig, ChargerConfig, ContactorConfig, Rs485, Station
from orchestrator.devices.dialogue import REQUESTS, SILENCE, Dialogue
from orchestrator.devices.poll import poll
from orchestrator.errors import LinkError, ServiceError
from orchestrator.link.can import CanBus
from orchestrator.link.gpio import describe
from orchestrator.link.serial import SerialLine
from orchestrator.model import Cause, ChargerReading
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
    """Probe the named bays, or all; 0 if every device answered and no charger reads another bay's volts, else 1.

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
    silent, volts = [], []
    chosen = [known[name] for name in bays] or list(station.bays)
    for bay in chosen:
        show(f"=== {bay.name}")
        reading = _charger(bay.charger, show)
        if reading is None:
            silent.append(f"{bay.name}'s charger")
        if bay.contactor is not None and not _contactor(bay.contactor, show):
            silent.append(f"{bay.name}'s contactor")
        answers, pack_v = _bmu(station, bay, NMT[nmt] if nmt else None, old_protocol=old_protocol, show=show)
        if not answers:
            silent.append(f"{bay.name}'s BMU")
        differ_v = volts_differ(bay.policy.faults, pack_v or 0.0)
        volts.append(Volts(bay.name, reading.voltage_v if reading is not None else None, pack_v, differ_v))
    _together(station, chosen, volts, show)
    show(f"NO ANSWER: {', '.join(silent)}" if silent else "every device answered")
    return 1 if silent or any(swapped(volts)) else 0


def _together(station: Station, bays: Sequence[BayConfig], volts: Sequence[Volts], show: Show) -> None:
    """What only shows between bays: who is on the buses, and whose volts a charger reads."""
    show("=== together")
    for name in dict.fromkeys(bay.battery.can for bay in bays):
        own = {bay.battery.node_id: bay.name for bay in station.bays if bay.battery.can == name}
        try:
            lines = list(listed(name, nodes_on(name, station.can[name]), own))
        except LinkError as error:
            lines = [f"nodes on {name}: {say(error.cause)}"]
        for line in lines:
            show(line)
    for line in compared(volts):
        show(line)


# --- the charger -----------------------------------------------------------------------------------------------------


def _charger(config: ChargerConfig, show: Show) -> ChargerReading | None:
    try:
        line = SerialLine.open(config.port, kernel_rs485=config.rs485 is Rs485.KERNEL)
    except LinkError as error:
        show(f"charger: {say(error.cause)}")
        return None
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
        return None
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
    return reading


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


def _bmu(
    station: Station, bay: BayConfig, nmt: NmtCommand | None, *, old_protocol: bool, show: Show
) -> tuple[bool, float | None]:
    """Whether it answers all, and the volts of its pack."""
    name = bay.battery.can
    bus = CanBus(name, station.can[name], [bay.battery.node_id], pages=old_protocol, filtered=False)
    bmu = BmuProbe(bus, bay.battery, show)
    try:
        bus.open()
        return bmu.run(nmt, old_protocol=old_protocol), bmu.volts
    except LinkError as error:
        show(f"BMU: {say(error.cause)}")
        return False, None
    finally:
        bus.close()
