"""The SDO exchange against the document's own samples, and against any bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.protocol.sdo import (
    ABORT_MEANINGS,
    NMT_COB_ID,
    NmtCommand,
    NmtState,
    SdoAbort,
    SdoMalformed,
    SdoReply,
    SdoValue,
    SdoWritten,
    heartbeat_cob_id,
    nmt_frame,
    parse_reply,
    read_request,
    reply_cob_id,
    request_cob_id,
    tpdo_cob_id,
    write_request,
)
from tests.protocol.vectors import BMU, Exchange

NODE = 0x10
GOLDEN: list[tuple[bytes, SdoReply]] = [
    (read_request(0x6000, 0), SdoValue(0x6000, 0, 0x0940FFF8, 4)),
    (read_request(0x1800, 5), SdoValue(0x1800, 5, 1000, 2)),
    (write_request(0x1800, 5, 500, 2), SdoWritten(0x1800, 5)),
    (write_request(0x1800, 2, 254, 1), SdoWritten(0x1800, 2)),
    (read_request(0x1800, 2), SdoValue(0x1800, 2, 255, 1)),
]


@pytest.mark.parametrize(
    ("exchange", "ours"), list(zip(BMU, GOLDEN, strict=True)), ids=[one.request.hex(" ").upper() for one in BMU]
)
def test_the_documents_exchanges(exchange: Exchange, ours: tuple[bytes, SdoReply]) -> None:
    request, reply = ours
    assert (request_cob_id(NODE), request) == (exchange.request_cob_id, exchange.request)
    assert (reply_cob_id(NODE), parse_reply(exchange.reply)) == (exchange.reply_cob_id, reply)


def test_an_object_is_asked_for_with_0x40_and_nothing_behind_its_sub_index() -> None:
    assert read_request(0x1018, 4) == bytes.fromhex("40 18 10 04 00 00 00 00")


def test_four_bytes_are_written_with_0x23() -> None:
    assert write_request(0x1017, 1, 0x12345678, 4) == bytes.fromhex("23 17 10 01 78 56 34 12")


@pytest.mark.parametrize(("value", "size"), [(256, 1), (-1, 1), (0x10000, 2), (1 << 32, 4), (0, 0), (0, 3), (0, 8)])
def test_a_value_that_does_not_fit_cannot_be_written(value: int, size: int) -> None:
    with pytest.raises(ValueError, match=f"{value} in {size} bytes"):
        write_request(0x1017, 0, value, size)


@pytest.mark.parametrize(("index", "sub"), [(0x10000, 0), (-1, 0), (0, 256), (0, -1)])
def test_an_object_outside_the_dictionary_cannot_be_asked_for(index: int, sub: int) -> None:
    with pytest.raises(ValueError, match="an index has 16 bits"):
        read_request(index, sub)


@pytest.mark.parametrize("code", ABORT_MEANINGS)
def test_a_refusal_has_its_meaning(code: int) -> None:
    abort = parse_reply(bytes.fromhex("80 04 60 00") + code.to_bytes(4, "little"))
    assert abort == SdoAbort(0x6004, 0, code)
    assert str(abort) == f"0x6004:00 aborted with 0x{code:08X}: {ABORT_MEANINGS[code]}"


def test_a_refusal_for_no_known_reason_is_still_a_refusal() -> None:
    abort = parse_reply(bytes.fromhex("80 01 60 02 EF BE AD DE"))
    assert str(abort) == "0x6001:02 aborted with 0xDEADBEEF: not a documented reason"


@pytest.mark.parametrize(
    ("wire", "reason"),
    [
        ("", "0 bytes, expected 8: "),
        ("43 00 60", "3 bytes, expected 8: 43 00 60"),
        ("43 00 60 00 F8 FF 40", "7 bytes, expected 8: 43 00 60 00 F8 FF 40"),
        ("43 00 60 00 F8 FF 40 09 00", "9 bytes, expected 8: 43 00 60 00 F8 FF 40 09 00"),
        ("41 00 60 00 FF FF FF 7F", "command 0x41, expected 43, 4B, 4F, 60 or 80: 41 00 60 00 FF FF FF 7F"),
        ("00 31 32 33 34 35 36 37", "command 0x00, expected 43, 4B, 4F, 60 or 80: 00 31 32 33 34 35 36 37"),
    ],
)
def test_what_is_no_expedited_reply_says_what_it_is(wire: str, reason: str) -> None:
    assert parse_reply(bytes.fromhex(wire)) == SdoMalformed(reason)


@given(st.binary(max_size=70))
def test_no_bytes_raise(wire: bytes) -> None:
    assert parse_reply(bytearray(wire)) == parse_reply(wire)


@given(st.integers(0, 0xFFFF), st.integers(0, 255), st.sampled_from([1, 2, 4]), st.data())
def test_a_value_comes_back_in_its_declared_size(index: int, sub: int, size: int, data: st.DataObject) -> None:
    value = data.draw(st.integers(0, (1 << 8 * size) - 1))
    write = write_request(index, sub, value, size)
    answer = bytes({1: [0x4F], 2: [0x4B], 4: [0x43]}[size]) + write[1:]
    assert parse_reply(answer) == SdoValue(index, sub, value, size)


@pytest.mark.parametrize(
    ("wire", "value", "size"),
    [
        ("4F 02 18 01 FF AA BB CC", 0xFF, 1),
        ("4B 05 18 01 E8 03 BB CC", 1000, 2),
        ("43 05 18 01 01 02 03 04", 0x04030201, 4),
    ],
)
def test_what_stands_behind_a_short_value_means_nothing(wire: str, value: int, size: int) -> None:
    reply = parse_reply(bytes.fromhex(wire))
    assert isinstance(reply, SdoValue)
    assert (reply.value, reply.size) == (value, size)


def test_cob_ids_and_nmt() -> None:
    assert (request_cob_id(1), reply_cob_id(127), heartbeat_cob_id(0x10)) == (0x601, 0x5FF, 0x710)
    assert [tpdo_cob_id(number, 0x10) for number in (1, 2, 3, 4)] == [0x190, 0x290, 0x390, 0x490]
    assert NMT_COB_ID == 0
    assert [nmt_frame(command, 0x10).hex() for command in NmtCommand] == ["0110", "0210", "8010", "8110", "8210"]
    assert [state.value for state in NmtState] == [0x00, 0x04, 0x05, 0x7F]
