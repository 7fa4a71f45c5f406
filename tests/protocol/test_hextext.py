"""Hexadecimal as people paste it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.errors import HexError
from orchestrator.protocol.hextext import hex_of, parse_hex

STOP = bytes.fromhex("AFFA900410900034AFA0")


@pytest.mark.parametrize(
    "text",
    [
        "AF FA 90 04 10 90 00 34 AF A0",
        "affa900410900034afa0",
        "0xAF,0xFA,0x90,0x4,0x10,0x90,0x0,0x34,0xAF,0xA0",
        "0xAF0xFA0x90041090 0X0034AFA0",
        "[AF:FA:90:04:10:90:00:34:AF:A0]",
        "AF-FA-90-04\n10-90-00-34\tAF|A0;",
        r"\xaf\xfa\x90\x04\x10\x90\x00\x34\xaf\xa0",
        "{ 0xAF, 0xFA, 0x90, 4, 10, 90, 0, 34, 0xAF, 0xA0 }",
        "<AFFA> (9004) 1090 0034 AFA0",
    ],
)
def test_any_usual_notation_is_read(text: str) -> None:
    assert parse_hex(text) == STOP


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no bytes given; write them as AF FA 90 …"),
        (" ,; ", "no bytes given; write them as AF FA 90 …"),
        ("AF GA 90", "not hexadecimal: 'G' at character 4"),
        ("stop 9Z", "not hexadecimal: 'stop' at character 1, 'Z' at character 7"),
        ("0xAF 0xFO", "not hexadecimal: 'O' at character 9"),
        ("AF FA9 90 004", "an odd number of digits: 'FA9' at character 4, '004' at character 11; a byte has two"),
    ],
)
def test_what_is_not_hexadecimal_is_named_with_its_place(text: str, says: str) -> None:
    with pytest.raises(HexError) as wrong:
        parse_hex(text)
    assert str(wrong.value) == says


@given(st.binary(min_size=1, max_size=64))
def test_bytes_survive_being_printed_and_read(data: bytes) -> None:
    assert parse_hex(hex_of(data)) == data == parse_hex(data.hex())


@given(st.text(max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        assert len(parse_hex(text)) > 0
    except HexError as wrong:
        assert str(wrong)
