"""The only frames that may be written to a CAN bus: the last check before the wire, for every frame.

Allowed are reads of objects, the two kinds of timers in the CANopen manual (§2.5, §2.6) and NMT commands (§3.7), each
to a node named in the station file. The limits are declared here again, independently of the station file: a timer of a
millisecond would fill the bus. The older protocol's request (`protocol/pages.py`) is allowed only on demand.
"""

from collections.abc import Collection, Mapping

from orchestrator.protocol.pages import pages_request, pages_request_cob_id
from orchestrator.protocol.sdo import FRAME_BYTES, NMT_COB_ID, NmtCommand

_SDO_BASE = 0x600
_NMT_COMMANDS = frozenset(int(command) for command in NmtCommand)
_READ = 0x40
_WRITE_U16 = 0x2B
_RESERVED = 0x2150  #: used inside CANopenNode, "leave it alone" (§1.4): not even read

#: The writable objects, all of them 16-bit timers: (index, sub) → minimum and maximum in milliseconds.
WRITABLE: Mapping[tuple[int, int], tuple[int, int]] = {
    (0x1017, 0): (100, 2000),  # heartbeat
    (0x1800, 5): (50, 1000),  # event timers of TPDO 1, 2 and 3
    (0x1801, 5): (50, 1000),
    (0x1802, 5): (50, 1000),
}


def refusal(cob_id: int, data: bytes, nodes: Collection[int], *, pages: bool = False) -> str:
    """Why this frame must not be sent; "" if it may.

    `nodes` are the station's node ids. `pages`: their older protocol may be used as well.
    """
    if cob_id == NMT_COB_ID:
        return _nmt_refusal(data, nodes)
    if pages and any(cob_id == pages_request_cob_id(node) and data == pages_request(node) for node in nodes):
        return ""
    if cob_id - _SDO_BASE in nodes:
        return _sdo_refusal(data)
    return f"COB-ID 0x{cob_id:X} is not an SDO request to a node of this station, nor NMT"


def _nmt_refusal(data: bytes, nodes: Collection[int]) -> str:
    if len(data) != 2 or data[0] not in _NMT_COMMANDS:
        return f"{data.hex(' ').upper() or 'nothing'} is not an NMT command"
    if data[1] not in nodes:
        return f"NMT to node 0x{data[1]:02X}, which is not of this station"
    return ""


def _sdo_refusal(data: bytes) -> str:
    if len(data) != FRAME_BYTES:
        return f"an SDO request of {len(data)} bytes"
    index, sub = data[1] | data[2] << 8, data[3]
    if data[0] == _READ and not any(data[4:]) and index != _RESERVED:
        return ""
    limits = WRITABLE.get((index, sub))
    if data[0] == _WRITE_U16 and limits and not any(data[6:]):
        low, high = limits
        if low <= data[4] | data[5] << 8 <= high:
            return ""
    return f"SDO request {data.hex(' ').upper()} is neither a read nor one of {_WRITABLE_NAMES}"


_WRITABLE_NAMES = ", ".join(f"0x{i:04X}:{sub:02X} = {low} … {high} ms" for (i, sub), (low, high) in WRITABLE.items())
