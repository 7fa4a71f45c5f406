"""Requests and longer replies of other masters, from CiA 301, §7.2.4.3."""

import pytest

from orchestrator.protocol.sdo_others import Ask, Part, SdoPart, SdoRequest, parse_part, parse_request, segment_number


@pytest.mark.parametrize(
    ("data", "request_"),
    [
        ("40 00 60 00 00 00 00 00", SdoRequest(Ask.READ, 0x6000, 0)),
        ("23 00 18 01 90 01 00 00", SdoRequest(Ask.WRITE, 0x1800, 1)),
        ("2B 17 10 00 F4 01 00 00", SdoRequest(Ask.WRITE, 0x1017, 0, 500)),
        ("2B 17 10 00 F4 01 01 01", SdoRequest(Ask.WRITE, 0x1017, 0, 500)),  # the last two bytes are not the value's
        ("21 50 1F 01 00 10 00 00", SdoRequest(Ask.WRITE, 0x1F50, 1)),
        ("00 01 02 03 04 05 06 07", SdoRequest(Ask.ON)),
        ("1F 01 00 00 00 00 00 00", SdoRequest(Ask.ON)),
        ("60 00 00 00 00 00 00 00", SdoRequest(Ask.ON)),
        ("70 00 00 00 00 00 00 00", SdoRequest(Ask.ON)),
        ("80 08 10 00 00 00 04 05", SdoRequest(Ask.ABORT, 0x1008, 0)),
        ("A4 08 10 00 7F 00 00 00", SdoRequest(Ask.BLOCK_READ, 0x1008, 0)),
        ("A3 00 00 00 00 00 00 00", SdoRequest(Ask.STREAM)),
        ("A2 05 7F 00 00 00 00 00", SdoRequest(Ask.STREAM)),
        ("A1 00 00 00 00 00 00 00", SdoRequest(Ask.ON)),
        ("C6 50 1F 01 00 10 00 00", SdoRequest(Ask.BLOCK_WRITE, 0x1F50, 1)),
        ("C1 00 00 00 00 00 00 00", SdoRequest(Ask.ON)),
        ("E0 00 00 00 00 00 00 00", None),
        ("40 00 60 00", None),
        ("", None),
    ],
)
def test_a_request(data: str, request_: SdoRequest | None) -> None:
    assert parse_request(bytes.fromhex(data)) == request_


@pytest.mark.parametrize(
    ("data", "part"),
    [
        ("41 08 10 00 1D 00 00 00", SdoPart(Part.BEGIN, 0x1008, 0)),
        ("41 18 10 04 1D 00 00 00", SdoPart(Part.BEGIN, 0x1018, 4)),
        ("40 08 10 00 00 00 00 00", SdoPart(Part.BEGIN, 0x1008, 0)),
        ("00 54 41 42 4F 53 20 62", SdoPart(Part.MORE)),
        ("1D 54 00 00 00 00 00 00", SdoPart(Part.LAST)),
        ("20 00 00 00 00 00 00 00", SdoPart(Part.MORE)),
        ("C6 08 10 00 1D 00 00 00", SdoPart(Part.BEGIN, 0x1008, 0)),
        ("C6 18 10 04 1D 00 00 00", SdoPart(Part.BEGIN, 0x1018, 4)),
        ("D9 DE 9D 00 00 00 00 00", SdoPart(Part.LAST, 0x9DDE, 0)),
        ("A4 50 1F 01 7F 00 00 00", SdoPart(Part.BEGIN, 0x1F50, 1)),
        ("A2 05 7F 00 00 00 00 00", SdoPart(Part.MORE, 0x7F05, 0)),
        ("A1 00 00 00 00 00 00 00", SdoPart(Part.LAST)),
        ("A3 00 00 00 00 00 00 00", SdoPart(Part.MORE)),  # no kind of reply that CiA 301 knows
        ("43 00 60 00 F8 FF 40 09", None),
        ("60 17 10 00 00 00 00 00", None),
        ("80 00 60 00 00 00 02 06", None),
        ("41 08 10", None),
    ],
)
def test_a_reply(data: str, part: SdoPart | None) -> None:
    assert parse_part(bytes.fromhex(data)) == part


def test_the_number_of_a_segment_is_without_its_last_mark() -> None:
    assert [segment_number(bytes((first, *range(7)))) for first in (0x01, 0x7F, 0x85)] == [1, 127, 5]


@pytest.mark.parametrize("data", ["", "01", "01 00 00 00 00 00 00", "01 00 00 00 00 00 00 00 00"])
def test_what_has_not_the_length_of_a_frame_is_no_segment(data: str) -> None:
    assert segment_number(bytes.fromhex(data)) == 0
