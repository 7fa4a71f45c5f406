"""The BMU's older protocol, which is not CANopen: three pages that carry the values of the object map in a known order.

It is not in the BMU's document; request, pages and units are those of public robot software that reads the same BMUs.
So nothing is charged by it: it only helps to find out which object map is right (`orchestrator probe --old-protocol`).
A request is one byte; each page is one frame: the request's byte, the page's number, then the values, little-endian.
The COB-ID of the pages is not known.
"""

from orchestrator.keys import Range
from orchestrator.protocol.objects import Evidence, FieldMap, ObjectEntry, Sweep
from orchestrator.protocol.words import Decoded, decode_word

_VALUE_BYTES = 6  #: of a page, behind the echo and the page's number


def pages_request_cob_id(node_id: int) -> int:
    """Where a node is asked for its pages."""
    return 0x460 + node_id


def pages_request(node_id: int) -> bytes:
    """The data of the request; the pages begin with it."""
    return bytes((0x60 + node_id,))


def _field(name: str, first_bit: int, width: int, scale: float, low: float, high: float) -> FieldMap:
    return FieldMap(
        name=name,
        first_bit=first_bit,
        width=width,
        signed=low < 0,
        scale=scale,
        unavailable=0xFFFF if name.endswith("_min") else None,  # as in the object maps
        range=Range(low, high),
        evidence=Evidence.ASSUMED,
    )


def _page(number: int, *fields: FieldMap) -> ObjectEntry:
    return ObjectEntry(index=number, size=_VALUE_BYTES, sweep=Sweep.SLOW, fields=fields)


#: By number; a page is written down as an object of six bytes.
PAGES = {
    1: _page(
        1,
        _field("voltage_v", 0, 16, 0.01, 0, 100),
        _field("current_a", 16, 16, 0.01, -327, 327),
        _field("status", 32, 16, 1, 0, 127),
    ),
    2: _page(
        2,
        _field("time_to_full_min", 0, 16, 1, 0, 65534),
        _field("time_to_empty_min", 16, 16, 1, 0, 65534),
        _field("soc_pct", 32, 8, 1, 0, 100),
        _field("soh_pct", 40, 8, 1, 0, 100),
    ),
    3: _page(
        3,
        _field("remaining_ah", 0, 16, 0.01, 0, 655.34),
        _field("available_wh", 16, 16, 0.1, 0, 6553.4),
        _field("temperature_c", 32, 16, 0.1, -39.9, 124.9),
    ),
}


def parse_page(node_id: int, data: bytes) -> dict[str, Decoded]:
    """The values on a page of this node; nothing for any other frame."""
    if len(data) != 2 + _VALUE_BYTES or data[:1] != pages_request(node_id) or data[1] not in PAGES:
        return {}
    return decode_word(PAGES[data[1]], int.from_bytes(data[2:], "little"), _VALUE_BYTES, 0.0)
