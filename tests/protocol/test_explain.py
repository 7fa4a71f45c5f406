"""The explanation of pasted frames, for a person reading a serial log and for a program."""

import json
from textwrap import dedent

import pytest
from hypothesis import example, given

from orchestrator.errors import HexError
from orchestrator.protocol.explain import Explained, explain
from orchestrator.protocol.frame import ADDRESS, Frame, FrameDecoder
from orchestrator.protocol.hextext import hex_of
from tests.protocol.streams import streams
from tests.protocol.vectors import CHARGER, GOOD, ChargerVector

VECTOR = {vector.name: vector for vector in CHARGER}
STOP = "AF FA 90 04 10 90 00 34 AF A0"


def only(text: str, kinds: tuple[int, int] | None = None) -> Explained:
    (one,) = explain(text, kinds)
    return one


def of(command: int, data: bytes, order: int = ADDRESS, kinds: tuple[int, int] | None = None) -> Explained:
    return only(hex_of(Frame(command, order, data).encode()), kinds)


def test_a_good_frame_is_told_field_by_field() -> None:
    assert only("AF FA 90 09 03 90 13 93 09 07 00 03 E5 AF A0", (3, 4)).text == dedent("""\
            byte 0: status reply, 15 bytes, good
              start     AF FA
              address   90
              length    09     9: command, order, 6 bytes of data, checksum
              command   03     status reply (charger → controller)
              order     90     the charger meant
              data      13 93  voltage 50.11 V
                        09 07  current 23.11 A
                        00 03  charge mode 3 (precharge)
              checksum  E5     good
              end       AF A0""")


def test_the_documents_misprint_is_told_as_what_it_is() -> None:
    told = only(hex_of(VECTOR["error_as_printed"].wire))
    assert told.text == dedent("""\
            byte 0: not a good frame: checksum 0x39, expected 0x68
              start     AF FA
              address   90
              length    07     7: command, order, 4 bytes of data, checksum
              command   1F     error (charger → controller: the frame that it received was bad)
              order     03     what was wrong: length, command
              data      11     length that it received
                        10     command that it received
                        05     order that it received
                        89     checksum that it received
              checksum  39     wrong, expected 68
              end       AF A0
              ! This is the example of §3.3.5: the document prints 0x39, the sum is 0x68. A charger would send 0x68.""")
    assert (told.ok, told.facts["valid"], told.facts["checksum"]) == (False, False, {"got": 0x39, "expected": 0x68})


@pytest.mark.parametrize("vector", GOOD, ids=str)
def test_every_golden_frame_is_explained_to_a_program(vector: ChargerVector) -> None:
    kinds = (vector.requested["kind1"], vector.requested["kind2"]) if vector.requested else None
    told = only(hex_of(vector.wire), kinds)
    assert told.ok
    assert {"frame": True, "valid": True, "problems": [], "hex": hex_of(vector.wire)}.items() <= told.facts.items()
    decoded = told.facts["decoded"]
    assert isinstance(decoded, dict)
    assert vector.decoded.items() <= decoded.items()


def test_a_good_frame_is_facts_to_a_program() -> None:
    assert only(STOP).facts == {
        "offset": 0,
        "hex": STOP,
        "frame": True,
        "valid": True,
        "name": "stop/resume",
        "command": 0x10,
        "order": 0x90,
        "data": "00",
        "decoded": {"rest": 0},
        "checksum": {"got": 0x34, "expected": 0x34},
        "problems": [],
    }


FACTS = [
    (0x01, b"\x03\x04", {"kind1": 3, "kind2": 4, "asks": ["voltage_v", "current_a", "charge_mode"]}),
    (0x01, b"\x00\x00", {"kind1": 0, "kind2": 0, "asks": []}),
    (0x02, b"\x01\x01", {"push": 1, "value": 1}),
    (0x10, b"\x01", {"rest": 1}),
]


@pytest.mark.parametrize(("command", "data", "decoded"), FACTS)
def test_what_is_sent_is_decoded(command: int, data: bytes, decoded: dict[str, object]) -> None:
    assert of(command, data).facts["decoded"] == decoded


@pytest.mark.parametrize(
    ("command", "data", "line"),
    [
        (0x01, b"\x03\x04", "03     kind 1: voltage, current"),
        (0x01, b"\x03\x04", "04     kind 2: charge mode"),
        (0x01, b"\x00\x1f", "00     kind 1: none"),
        (0x01, b"\x00\x03", "03     kind 2: operation, current limit"),
        (0x01, b"\x01\x00", "00     kind 2: none"),
        (0x01, b"\x0c\x00", "0C     kind 1: temperature 1, temperature 2"),
        (0x01, b"\x20\x80", "20     kind 1: void 20 00"),
        (0x01, b"\x20\x80", "80     kind 2: void 00 80"),
        (0x01, b"\x01\x00", "01     status request (controller → charger)"),
        (0x02, b"\x01\x00", "02     set value (controller → charger, acted on in manual mode only)"),
        (0x02, b"\x01\x00", "01     push: operation"),
        (0x02, b"\x01\x00", "00     0: stop"),
        (0x02, b"\x01\x01", "01     1: run"),
        (0x02, b"\x02\x00", "02     push: current limit"),
        (0x02, b"\x02\x00", "00     0: step 1, the lowest"),
        (0x02, b"\x02\x01", "01     1: step 2"),
        (0x02, b"\x02\x02", "02     2: step 3"),
        (0x02, b"\x02\x03", "03     3: step 4"),
        (0x02, b"\x02\x04", "04     4: step 5, the highest"),
        (0x02, b"\x04\x03", "04     push: charge mode"),
        (0x02, b"\x04\x03", "03     3: precharge"),
        (0x02, b"\x04\x04", "04     4: charge"),
        (0x02, b"\x04\x05", "05     5: standby"),
        (0x02, b"\x08\x00", "08     push: precharge function"),
        (0x02, b"\x08\x00", "00     0: off"),
        (0x02, b"\x08\x01", "01     1: pulse"),
        (0x02, b"\x08\x02", "02     2: continuous"),
        (0x10, b"\x00", "10     stop/resume (controller → charger)"),
        (0x10, b"\x00", "00     stop: to standby, whatever it is doing"),
        (0x10, b"\x01", "01     resume: from standby back to normal"),
        (0x1F, bytes(4), "90     what was wrong: no documented bit is set"),
    ],
)
def test_every_kind_of_order_has_its_words(command: int, data: bytes, line: str) -> None:
    told = of(command, data)
    assert line in [row[12:] for row in told.text.splitlines()]
    assert told.ok


@pytest.mark.parametrize(
    ("command", "data", "order", "kinds", "problem"),
    [
        (0x02, b"\x04\x07", ADDRESS, None, "charge mode 7 (documented: 3, 4, 5)"),
        (0x02, b"\x03\x01", ADDRESS, None, "push 0x03 (documented: 1, 2, 4, 8)"),
        (0x02, b"\x01", ADDRESS, None, "data of 1 byte, expected 2"),
        (0x10, b"\x02", ADDRESS, None, "rest 2 (documented: 0, 1)"),
        (0x10, b"", ADDRESS, None, "data of 0 bytes, expected 1"),
        (0x10, b"\x00", 0x91, None, "order 0x91, expected 0x90: it must equal the address"),
        (0x44, bytes(12), ADDRESS, None, "command 0x44 is not documented"),
        (0x03, bytes(6), ADDRESS, (0x13, 0x1F), "kinds 0x13 0x1F are answered with 16 data bytes, got 6"),
        (0x03, bytes(5), ADDRESS, None, "data of 5 bytes, but every value has two"),
        (0x03, b"\x00\x09", ADDRESS, (0, 4), "charge mode 9 (documented: 1 … 8)"),
        (0x1F, bytes(3), 1, None, "data of 3 bytes, expected 4"),
    ],
)
def test_a_whole_frame_that_is_not_as_documented_says_so(
    command: int, data: bytes, order: int, kinds: tuple[int, int] | None, problem: str
) -> None:
    told = of(command, data, order, kinds)
    assert (told.ok, told.facts["valid"], told.facts["problems"]) == (False, True, [problem])
    assert ", a whole frame, but not as documented\n" in told.text
    assert told.text.endswith(f"! {problem}")


def test_a_command_that_nobody_knows_is_told_as_such() -> None:
    assert of(0x44, b"").text == dedent("""\
            byte 0: unknown command, 9 bytes, a whole frame, but not as documented
              start     AF FA
              address   90
              length    03     3: command, order, 0 bytes of data, checksum
              command   44     unknown command (not documented)
              order     90     the charger meant
              checksum  67     good
              end       AF A0
              ! command 0x44 is not documented""")


def test_data_without_a_meaning_is_shown_in_rows_of_eight() -> None:
    told = of(0x44, bytes(range(17)))
    assert [line[2:].rstrip() for line in told.text.splitlines()[6:-3]] == [
        "data      00 01 02 03 04 05 06 07",
        "          08 09 0A 0B 0C 0D 0E 0F",
        "          10",
    ]


# --- which values a reply holds --------------------------------------------------------------------------------------

SHORT_REPLY = "AF FA 90 09 03 90 13 93 09 07 00 03 E5 AF A0"


def test_a_reply_of_the_services_own_length_is_taken_for_its_kinds() -> None:
    told = of(0x03, bytes.fromhex("13930907000100010004000200020001"))
    assert told.facts["decoded"] == {
        "kind1": 0x13,
        "kind2": 0x1F,
        "voltage_v": 50.11,
        "current_a": 23.11,
        "control_mode": 1,
        "operation": 1,
        "current_step": 4,
        "charge_mode": 2,
        "precharge": 2,
        "connection": 1,
    }
    assert [line[12:] for line in told.text.splitlines()[6:-2]] == [
        "13 93  voltage 50.11 V",
        "09 07  current 23.11 A",
        "00 01  control mode 1 (manual)",
        "00 01  operation 1 (running)",
        "00 04  current limit 4 (step 5, the highest)",
        "00 02  charge mode 2 (battery recovery)",
        "00 02  precharge function 2 (continuous)",
        "00 01  battery connection 1 (normal)",
        "       taken for the kinds 0x13 0x1F that the service asks for",
    ]


def test_a_value_that_is_not_documented_is_none_to_a_program() -> None:
    told = of(0x03, b"\x00\x09", kinds=(0, 4))
    assert told.facts["decoded"] == {"kind1": 0, "kind2": 4, "charge_mode": None}
    assert "  data      00 09  charge mode 9 (documented: 1 … 8)\n" in told.text


@pytest.mark.parametrize(
    ("data", "words", "line"),
    [("1393 0907 0003", [5011, 2311, 3], "13 93 09 07 00 03"), ("1393 0907", [5011, 2311], "13 93 09 07")],
)
def test_a_reply_to_nobody_knows_what_is_shown_as_words(data: str, words: list[int], line: str) -> None:
    told = of(0x03, bytes.fromhex(data))
    assert (told.ok, told.facts["decoded"]) == (True, {"words": words})
    assert [row[12:] for row in told.text.splitlines()[6:-2]] == [
        line,
        " " * len(line) + "  a reply does not say which values it holds: give the kinds of its request",
    ]


def test_a_reply_is_decoded_by_the_request_before_it() -> None:
    _, told = explain(f"AF FA 90 05 01 90 03 04 2D AF A0 {SHORT_REPLY}")
    assert told.facts["decoded"] == {
        "kind1": 3,
        "kind2": 4,
        "voltage_v": 50.11,
        "current_a": 23.11,
        "charge_mode": 3,
    }


def test_the_kinds_that_a_person_gives_win_over_those_of_a_request() -> None:
    _, told = explain(f"AF FA 90 05 01 90 00 07 2D AF A0 {SHORT_REPLY}", (0x07, 0x00))
    assert told.facts["decoded"] == {
        "kind1": 7,
        "kind2": 0,
        "voltage_v": 50.11,
        "current_a": 23.11,
        "temperature_1_c": 0.3,
    }
    assert "\n            00 03  temperature 1 0.3 °C\n" in told.text


# --- bad frames and garbage ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        (
            "AF FA 91 04 10 91 00 36 AF A0",
            [
                "not a good frame: address 0x91, expected 0x90",
                "91     wrong, expected 90",
                "91     order 0x91, expected",
            ],
        ),
        (
            "AF FA 90 04 10 90 00 34 AF A1",
            ["not a good frame: end AF A1, expected AF A0", "AF A1  wrong, expected AF A0", "34     good"],
        ),
        (
            "AF FA 90 03 10 90 00 34 AF A0",
            [
                "checksum 0x00, expected 0x33; end 34 AF, expected AF A0",
                "! an end AF A0 stands after 10 bytes: the length of such a frame is 0x04",
                "byte 9: 1 byte outside of any frame (no start AF FA)",
            ],
        ),
        (
            "AF FA 90 FF 10 90 00 34 AF A0",
            [
                "length 0xFF, expected 0x03 … 0x23",
                "  rest      00 34 AF A0",
                "! an end AF A0 stands after 10 bytes: the length of such a frame is 0x04",
            ],
        ),
        ("AF FA 90 FF AF A0", ["  order     A0"]),
        (
            "AF FA 90 05 02",
            ["byte 0: not a good frame: incomplete: 5 bytes, its length 0x05 makes it 11", "  command   02"],
        ),
        ("AF FA", ["byte 0: not a good frame: incomplete: 2 bytes, the smallest frame has 9"]),
    ],
)
def test_a_bad_frame_says_what_is_wrong_with_it(text: str, lines: list[str]) -> None:
    told = explain(text)
    everything = "\n".join(one.text for one in told)
    assert not any(one.ok for one in told)
    for line in lines:
        assert line in everything


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        # The fields come after the reason.
        (
            "AF FA 91 04 10 91 00 36 AF A0",
            ["address 0x91, expected 0x90", "order 0x91, expected 0x90: it must equal the address"],
        ),
        # An end byte in its place is no hint, and no search follows.
        ("AF FA 90 04 10 90 00 35 AF A0", ["checksum 0x35, expected 0x34"]),
    ],
)
def test_a_bad_frame_of_the_length_that_it_declares_gets_no_hint(text: str, problems: list[str]) -> None:
    assert only(text).facts["problems"] == problems


ENDS_EARLY = "AF FA 90 23 10 90 00 34 AF A0"
LENGTH_04 = ["an end AF A0 stands after 10 bytes: the length of such a frame is 0x04"]


@pytest.mark.parametrize(
    ("text", "hints"),
    [
        (ENDS_EARLY, LENGTH_04),
        (f"{ENDS_EARLY} {ENDS_EARLY[6:]}", LENGTH_04),  # the first of two ends
        (f"{ENDS_EARLY} AF FA", LENGTH_04),  # a start after the end does not matter
        ("AF FA 90 23 10 AF FA 34 AF A0", []),  # the end of a frame starting before it
        ("AF FA AF FA 90 FF 00 00 AF A0", []),
        ("AF FA 90 23 10 90 AF A0 00 00", []),  # too short for a frame
        ("AF FA 90 23 10 90 33 AF A0 00", ["an end AF A0 stands after 9 bytes: the length of such a frame is 0x03"]),
    ],
)
def test_an_end_in_another_place_is_a_hint_unless_it_belongs_to_something_else(text: str, hints: list[str]) -> None:
    first, *_ = explain(text)
    problems = first.facts["problems"]
    assert isinstance(problems, list)
    assert problems[1:] == hints


def test_what_has_no_sensible_length_is_told_byte_by_byte() -> None:
    (told,) = explain("AF FA 90 FF 10 91 01 02 03 04 05 06 07 08 09")
    assert told.text == dedent("""\
            byte 0: not a good frame: length 0xFF, expected 0x03 … 0x23
              start     AF FA
              address   90
              length    FF
              command   10
              order     91
              rest      01 02 03 04 05 06 07 08
              rest      09""")
    assert told.facts == {
        "offset": 0,
        "hex": "AF FA 90 FF 10 91 01 02 03 04 05 06 07 08 09",
        "frame": True,
        "valid": False,
        "problems": ["length 0xFF, expected 0x03 … 0x23"],
    }


def test_a_damaged_reply_is_decoded_by_its_kinds_all_the_same() -> None:
    told = only(f"{SHORT_REPLY[:-8]}E6 AF A0", (3, 4))
    assert "13 93  voltage 50.11 V" in told.text
    assert not told.ok


def test_garbage_between_frames_is_shown_where_it_stands() -> None:
    told = explain(f"00 11 {STOP} {'55' * 17} {STOP} AF")
    assert [(one.facts["offset"], one.facts["frame"]) for one in told] == [
        (0, False),
        (2, True),
        (12, False),
        (29, True),
        (39, False),
    ]
    assert told[0].text == "byte 0: 2 bytes outside of any frame (no start AF FA)\n            00 11"
    assert told[0].facts == {"offset": 0, "hex": "00 11", "frame": False, "valid": False}
    assert [one.ok for one in told] == [False, True, False, True, False]
    assert [row.split() for row in told[2].text.splitlines()[1:]] == [["55"] * 16, ["55"]]


def test_a_good_frame_inside_a_false_start_is_explained_too() -> None:
    false_start, good = explain(f"AF FA 90 23 {STOP}")
    assert (false_start.ok, good.ok, good.facts["offset"]) == (False, True, 4)
    assert "an end AF A0 stands" not in false_start.text  # this end belongs to another frame


def test_a_false_start_reaches_to_the_next_start_where_its_length_makes_no_sense() -> None:
    noise, false_start, good = explain(f"00 00 AF FA 90 00 01 {STOP}")
    assert [one.facts["hex"] for one in (noise, false_start, good)] == ["00 00", "AF FA 90 00 01", STOP]


def test_text_that_is_not_hexadecimal_is_refused_with_its_place() -> None:
    with pytest.raises(HexError, match="'x' at character 4"):
        explain("AF x")


@given(streams.filter(len))
@example(b"\xaf\xfa" + bytes.fromhex(STOP))
def test_any_bytes_are_explained_and_the_good_frames_are_the_decoders(stream: bytes) -> None:
    told = explain(hex_of(stream))
    decoder = FrameDecoder()
    frames = decoder.feed(stream) + decoder.flush()
    assert [one.facts["hex"] for one in told if one.facts["valid"]] == [str(frame) for frame in frames]
    assert len([one for one in told if one.facts["frame"] and not one.facts["valid"]]) == decoder.bad_frames
    for one in told:
        assert json.loads(json.dumps(one.facts)) == one.facts
        assert one.text
