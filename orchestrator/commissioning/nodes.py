"""Which nodes are on a CAN bus, of those that the switch of a BMU can set: each is asked for its device type."""

from collections.abc import Iterator, Mapping
from functools import partial
from time import monotonic

from orchestrator.link.can import CanBus
from orchestrator.protocol.sdo import heartbeat_cob_id, read_request, reply_cob_id, request_cob_id, tpdo_cob_id

#: Node id = switch + 0x10 (the BMU's manual).
SWITCH = range(0x10, 0x20)
#: Every CANopen node has it.
DEVICE_TYPE = (0x1000, 0)
#: An answer takes no longer, even if all of them answer.
LISTEN_S = 0.6


def nodes_on(name: str, settings: Mapping[str, object]) -> list[int]:
    """The node ids from which anything is heard. LinkError if the bus fails."""
    heard: set[int] = set()
    bus = CanBus(name, settings, list(SWITCH), filtered=False)
    for node_id in SWITCH:
        note = partial(_note, heard, node_id)
        ids = (
            reply_cob_id(node_id),
            heartbeat_cob_id(node_id),
            *(tpdo_cob_id(number, node_id) for number in range(1, 5)),
        )
        for cob_id in ids:
            bus.subscribe(cob_id, note)
    try:
        bus.open()
        for node_id in SWITCH:
            bus.send(request_cob_id(node_id), read_request(*DEVICE_TYPE))
        end_s = monotonic() + LISTEN_S
        while (left_s := end_s - monotonic()) > 0:
            bus.receive(left_s)
    finally:
        bus.close()
    return sorted(heard)


def _note(heard: set[int], node_id: int, _cob_id: int, _data: bytes) -> None:
    heard.add(node_id)


def listed(name: str, heard: list[int], bays: Mapping[int, str]) -> Iterator[str]:
    """What is there, and what a station file with these bays on the bus expects in vain."""
    there = ", ".join(f"0x{node_id:02X} ({bays.get(node_id, 'no bay has it')})" for node_id in heard)
    yield f"nodes heard on {name} (0x{SWITCH[0]:02X} … 0x{SWITCH[-1]:02X}): {there or 'none'}"
    missing = [f"0x{node_id:02X} ({bay})" for node_id, bay in sorted(bays.items()) if node_id not in heard]
    others = [f"0x{node_id:02X}" for node_id in heard if node_id not in bays]
    if missing and others:
        yield f"not heard: {', '.join(missing)}; is battery.node_id, or the switch, one of {', '.join(others)}?"
