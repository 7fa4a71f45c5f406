"""The BMU's older protocol, which is not CANopen: three pages carrying the values of the object map in a known order.

The BMU's document does not describe it; request, pages and units come from public robot software that reads the same
BMUs. No charge relies on it: it only helps to identify the right object map (`orchestrator probe --old-protocol`). A
request is one byte. Each page is one frame: the request byte, the page number, then the values, little-endian. The
COB-ID of the pages is unknown.
"""

from functools import partial

from orchestrator.keys import Range
from orchestrator.protocol.objects import Evidence, FieldMap
from orchestrator.protocol.words import Decoded, decode_fields

_PAGE_BYTES = 8  #: the echoed request, the page number, and six bytes of values


def pages_request_cob_id(node_id: int) -> int:
    """The COB-ID for requesting a node's pages."""
    return 0x460 + node_id


def pages_request(node_id: int) -> bytes:
    """The data of the request; each page begins with it."""
    return bytes((0x60 + node_id,))


_field = partial(FieldMap, evidence=Evidence.ASSUMED)
_minutes = partial(_field, width=16, unavailable=0xFFFF, range=Range(0, 65534))  # as in the object maps

#: The values on each page, by page number.
PAGES = {
    1: (
        _field(name="voltage_v", first_bit=0, width=16, scale=0.01, range=Range(0, 100)),
        _field(name="current_a", first_bit=16, width=16, scale=0.01, signed=True, range=Range(-327, 327)),
        _field(name="status", first_bit=32, width=16, range=Range(0, 127)),
    ),
    2: (
        _minutes(name="time_to_full_min", first_bit=0),
        _minutes(name="time_to_empty_min", first_bit=16),
        _field(name="soc_pct", first_bit=32, width=8, range=Range(0, 100)),
        _field(name="soh_pct", first_bit=40, width=8, range=Range(0, 100)),
    ),
    3: (
        _field(name="remaining_ah", first_bit=0, width=16, scale=0.01, range=Range(0, 655.34)),
        _field(name="available_wh", first_bit=16, width=16, scale=0.1, range=Range(0, 6553.4)),
        _field(name="temperature_c", first_bit=32, width=16, scale=0.1, signed=True, range=Range(-39.9, 124.9)),
    ),
}


def parse_page(node_id: int, data: bytes) -> dict[str, Decoded]:
    """The values on a page from this node; empty for any other frame."""
    if len(data) != _PAGE_BYTES or data[:1] != pages_request(node_id) or data[1] not in PAGES:
        return {}
    return decode_fields(PAGES[data[1]], int.from_bytes(data[2:], "little"), 0.0)
