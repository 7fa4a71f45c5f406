"""The BMU's older protocol, which is not CANopen: three pages that carry the values of the object map in a known order.

It is not in the BMU's document; request, pages and units are those of public robot software that reads the same BMUs.
So nothing is charged by it: it only helps to find out which object map is right (`orchestrator probe --old-protocol`).
A request is one byte; each page is one frame: the request's byte, the page's number, then the values, little-endian.
The COB-ID of the pages is not known.
"""

from functools import partial

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


_field = partial(FieldMap, evidence=Evidence.ASSUMED)
_page = partial(ObjectEntry, size=_VALUE_BYTES, sweep=Sweep.SLOW)
_MINUTES = Range(0, 65534)

#: By number; a page is written down as an object of six bytes.
PAGES = {
    1: _page(
        index=1,
        fields=(
            _field(name="voltage_v", first_bit=0, width=16, scale=0.01, range=Range(0, 100)),
            _field(name="current_a", first_bit=16, width=16, scale=0.01, signed=True, range=Range(-327, 327)),
            _field(name="status", first_bit=32, width=16, range=Range(0, 127)),
        ),
    ),
    2: _page(
        index=2,
        fields=(  # not available is said as in the object maps
            _field(name="time_to_full_min", first_bit=0, width=16, unavailable=0xFFFF, range=_MINUTES),
            _field(name="time_to_empty_min", first_bit=16, width=16, unavailable=0xFFFF, range=_MINUTES),
            _field(name="soc_pct", first_bit=32, width=8, range=Range(0, 100)),
            _field(name="soh_pct", first_bit=40, width=8, range=Range(0, 100)),
        ),
    ),
    3: _page(
        index=3,
        fields=(
            _field(name="remaining_ah", first_bit=0, width=16, scale=0.01, range=Range(0, 655.34)),
            _field(name="available_wh", first_bit=16, width=16, scale=0.1, range=Range(0, 6553.4)),
            _field(name="temperature_c", first_bit=32, width=16, scale=0.1, signed=True, range=Range(-39.9, 124.9)),
        ),
    ),
}


def parse_page(node_id: int, data: bytes) -> dict[str, Decoded]:
    """The values on a page of this node; nothing for any other frame."""
    if len(data) != 2 + _VALUE_BYTES or data[:1] != pages_request(node_id) or data[1] not in PAGES:
        return {}
    return decode_word(PAGES[data[1]], int.from_bytes(data[2:], "little"), _VALUE_BYTES, 0.0)
