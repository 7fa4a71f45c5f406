"""The charger's messages against literal bytes, in both directions."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.errors import OrchestratorError, ProtocolError
from orchestrator.model import (
    STOP,
    Action,
    Cause,
    ChargeMode,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    ErrorBit,
    Operation,
    Precharge,
)
from orchestrator.protocol.charger import (
    OPERATION_STOP_FRAME,
    STATUS_KINDS,
    STATUS_REPLY_BYTES,
    STATUS_REQUEST,
    STATUS_VALUES,
    STOP_FRAME,
    Code,
    ErrorReply,
    Kind1,
    Kind2,
    encode,
    parse_error,
    parse_status,
    parse_values,
    reply_bytes,
    status_request,
)
from orchestrator.protocol.frame import ADDRESS, Frame, FrameDecoder
from orchestrator.text.catalogue import say
from tests.protocol.vectors import GOOD

VECTOR = {vector.name: vector for vector in GOOD}

#: Every command, with its frame worked out by hand from §3.2 and §4.2.
FRAMES = {
    STOP: "AF FA 90 04 10 90 00 34 AF A0",
    Command(Action.RESUME): "AF FA 90 04 10 90 01 35 AF A0",
    Command(Action.RUN): "AF FA 90 05 02 90 01 01 29 AF A0",
    Command(Action.SET_LIMIT, 0): "AF FA 90 05 02 90 02 00 29 AF A0",
    Command(Action.SET_LIMIT, 1): "AF FA 90 05 02 90 02 01 2A AF A0",
    Command(Action.SET_LIMIT, 2): "AF FA 90 05 02 90 02 02 2B AF A0",
    Command(Action.SET_LIMIT, 3): "AF FA 90 05 02 90 02 03 2C AF A0",
    Command(Action.SET_LIMIT, 4): "AF FA 90 05 02 90 02 04 2D AF A0",
    Command(Action.SET_MODE, 3): "AF FA 90 05 02 90 04 03 2E AF A0",
    Command(Action.SET_MODE, 4): "AF FA 90 05 02 90 04 04 2F AF A0",
    Command(Action.SET_MODE, 5): "AF FA 90 05 02 90 04 05 30 AF A0",
    Command(Action.SET_PRECHARGE, 0): "AF FA 90 05 02 90 08 00 2F AF A0",
    Command(Action.SET_PRECHARGE, 1): "AF FA 90 05 02 90 08 01 30 AF A0",
    Command(Action.SET_PRECHARGE, 2): "AF FA 90 05 02 90 08 02 31 AF A0",
}


def reply(*words: int) -> Frame:
    return Frame(Code.STATUS_REPLY, ADDRESS, b"".join(word.to_bytes(2, "big") for word in words))


# --- to the charger --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", FRAMES, ids=str)
def test_every_command_has_the_documents_frame(command: Command) -> None:
    assert encode(command) == bytes.fromhex(FRAMES[command])


@pytest.mark.parametrize("command", FRAMES, ids=str)
def test_every_command_comes_back_out_of_a_decoder(command: Command) -> None:
    (frame,) = FrameDecoder().feed(encode(command))
    assert frame.encode() == encode(command)
    assert (frame.order, len(frame.data)) == (ADDRESS, 1 if frame.command == Code.REST else 2)


def test_every_action_can_be_encoded() -> None:
    assert {command.action for command in FRAMES} == set(Action)


@pytest.mark.parametrize("action", sorted({*Action} - {Action.STOP}))
def test_what_the_document_does_not_list_cannot_be_encoded(action: Action) -> None:
    listed = [command.value for command in FRAMES if command.action is action]
    for value in {*range(-2, 260)} - {*listed}:
        with pytest.raises(ValueError, match=rf"^{action} {value}: the charger takes {str(listed)[1:-1]}$"):
            encode(Command(action, value))


def test_a_stop_is_never_refused() -> None:
    assert encode(Command(Action.STOP, 77)) == STOP_FRAME == VECTOR["stop"].wire
    assert OPERATION_STOP_FRAME.hex(" ").upper() == "AF FA 90 05 02 90 01 00 28 AF A0"


def test_status_requests() -> None:
    assert status_request(kind1=3, kind2=4) == VECTOR["status_request_kind1_03_kind2_04"].wire
    assert status_request() == STATUS_REQUEST == bytes.fromhex("AF FA 90 05 01 90 13 1F 58 AF A0")
    assert (Kind1(0x13), Kind2(0x1F)) == (
        Kind1.VOLTAGE | Kind1.CURRENT | Kind1.CONTROL_MODE,
        Kind2.OPERATION | Kind2.CURRENT_LIMIT | Kind2.CHARGE_MODE | Kind2.PRECHARGE | Kind2.CONNECTION,
    )


@pytest.mark.parametrize("kinds", [(256, 0), (0, 256), (-1, 0)])
def test_kinds_are_bytes(kinds: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="range"):
        status_request(*kinds)


# --- status replies --------------------------------------------------------------------------------------------------


def test_the_documents_reply() -> None:
    vector = VECTOR["reply_50V11_23A11_mode3"]
    (frame,) = FrameDecoder().feed(vector.wire)
    assert parse_values(frame, vector.requested["kind1"], vector.requested["kind2"]) == vector.decoded


def test_a_status_reply_fills_a_reading() -> None:
    frame = reply(5011, 2311, 1, 1, 4, 4, 2, 1)
    assert len(frame.encode()) == STATUS_REPLY_BYTES == 25
    assert parse_status(frame, STATUS_KINDS, 12.5) == ChargerReading(
        t_s=12.5,
        voltage_v=50.11,
        current_a=23.11,
        control_mode=ControlMode.MANUAL,
        operation=Operation.RUNNING,
        current_step=4,
        charge_mode=ChargeMode.CHARGE,
        precharge=Precharge.CONTINUOUS,
        connection=Connection.NORMAL,
    )


def test_a_reply_with_the_temperatures_fills_the_same_reading() -> None:
    with_temperatures = reply(5011, 2311, 251, 0xFFFF, 0, 0, 0, 5, 0, 0)
    without = reply(5011, 2311, 0, 0, 0, 5, 0, 0)
    assert parse_status(with_temperatures, (0x1F, 0x1F), 1.0) == parse_status(without, STATUS_KINDS, 1.0)


def test_voltage_and_current_reach_the_end_of_their_16_bits() -> None:
    assert parse_values(reply(0xFFFF, 0), 0x03, 0x00) == {"voltage_v": 655.35, "current_a": 0.0}


@pytest.mark.parametrize(
    ("raw", "celsius"), [(0, 0.0), (251, 25.1), (0x7FFF, 3276.7), (0x8000, -3276.8), (0xFFFF, -0.1)]
)
def test_temperatures_are_signed_tenths(raw: int, celsius: float) -> None:
    assert parse_values(reply(raw, raw), 0x0C, 0x00) == {"temperature_1_c": celsius, "temperature_2_c": celsius}


#: The position of each value in a default reply, its allowed values (§4.1.1), and the printed list of them.
LISTED = [
    (2, "control_mode", ControlMode, range(2), "control mode {} (documented: 0, 1)"),
    (3, "operation", Operation, range(2), "operation {} (documented: 0, 1)"),
    (4, "current_step", int, range(5), "current limit {} (documented: 0 … 4)"),
    (5, "charge_mode", ChargeMode, range(1, 9), "charge mode {} (documented: 1 … 8)"),
    (6, "precharge", Precharge, range(3), "precharge function {} (documented: 0 … 2)"),
    (7, "connection", Connection, range(2), "battery connection {} (documented: 0, 1)"),
]


@pytest.mark.parametrize(("at", "name", "kind", "documented", "sentence"), LISTED, ids=[row[1] for row in LISTED])
def test_every_documented_value_is_taken_and_every_other_one_said(
    at: int, name: str, kind: type[int], documented: range, sentence: str
) -> None:
    for value in [*range(12), 0x0100, 0x8000, 0xFFFF]:
        words = [5011, 2311, 1, 1, 4, 4, 2, 1]
        words[at] = value
        reading = parse_status(reply(*words), STATUS_KINDS, 0.0)
        got, row = getattr(reading, name), next(row for row in STATUS_VALUES if row.name == name)
        if value in documented:
            assert (got, reading.illegal) == (kind(value), ())
            assert isinstance(got, kind)
        else:
            assert (got, reading.illegal) == (None, (row.value(value),))
            assert row.refused(value) == sentence.format(value)
            assert say(reading.illegal[0]).endswith(sentence.partition("{}")[2].format(value))


def test_every_illegal_value_is_said_at_once() -> None:
    reading = parse_status(reply(1, 2, 3, 4, 5, 9, 3, 2), STATUS_KINDS, 0.0)
    assert (reading.voltage_v, reading.current_a, len(reading.illegal)) == (0.01, 0.02, 6)


@given(st.integers(0, 255), st.integers(0, 255), st.data())
def test_any_kinds_and_any_words_give_the_values_asked_for(kind1: int, kind2: int, data: st.DataObject) -> None:
    names = [
        *(name for bit, name in enumerate(["voltage_v", "current_a", "temperature_1_c", "temperature_2_c"])
          if kind1 >> bit & 1),
        *(["control_mode"] if kind1 & 0x10 else []),
        *(name for bit, name in enumerate(["operation", "current_step", "charge_mode", "precharge", "connection"])
          if kind2 >> bit & 1),
    ]  # fmt: skip
    voids = (kind1 >> 5).bit_count() + (kind2 >> 5).bit_count()
    count = len(names) + voids
    frame = reply(*data.draw(st.lists(st.integers(0, 0xFFFF), min_size=count, max_size=count)))
    assert len(frame.encode()) == reply_bytes(kind1, kind2)
    values = parse_values(frame, kind1, kind2)
    assert list(values)[: len(names)] == names
    assert len(values) == count
    assert all(name.startswith("void_") for name in list(values)[len(names) :])


def test_all_sixteen_kinds_fill_the_largest_frame_with_the_void_ones_last() -> None:
    values = parse_values(reply(*range(1, 17)), 0xFF, 0xFF)
    assert (reply_bytes(0xFF, 0xFF), len(STATUS_VALUES)) == (41, 16)
    assert [values[f"void_{bits}"] for bits in ("2000", "4000", "8000", "0020", "0040", "0080")] == [*range(11, 17)]
    operation = values["operation"]
    assert isinstance(operation, Cause)
    assert say(operation) == "operation 6 (documented: 0, 1)"


@pytest.mark.parametrize(
    ("frame", "got"),
    [
        (reply(5011, 2311, 3), "command 0x03, order 0x90, 6 data bytes"),
        (reply(5011, 2311, 3, 1, 0, 0, 0, 0, 0), "command 0x03, order 0x90, 18 data bytes"),
        (Frame(0x03, 0x91, bytes(16)), "command 0x03, order 0x91, 16 data bytes"),
        (Frame(0x1F, 0x90, bytes(16)), "command 0x1F, order 0x90, 16 data bytes"),
    ],
)
def test_what_is_no_answer_to_the_request_is_refused_with_both_sides(frame: Frame, got: str) -> None:
    with pytest.raises(ProtocolError) as refused:
        parse_status(frame, STATUS_KINDS, 0.0)
    expected = "expected command 0x03, order 0x90, 16 data bytes"
    assert str(refused.value) == f"{expected}; got {got} in {frame}"
    assert isinstance(refused.value, OrchestratorError)


@pytest.mark.parametrize("kinds", [(0x03, 0x04), (0x13, 0x0F), (0x12, 0x1F)])
def test_kinds_that_leave_a_reading_unfilled_are_our_mistake(kinds: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=f"kinds 0x{kinds[0]:02x} 0x{kinds[1]:02x} do not fill a reading"):
        parse_status(reply(1), kinds, 0.0)


# --- error frames ----------------------------------------------------------------------------------------------------


def test_the_documents_error_frame_with_its_sum_corrected() -> None:
    vector = VECTOR["error_corrected"]
    (frame,) = FrameDecoder().feed(vector.wire)
    error = parse_error(frame)
    assert error == ErrorReply(ErrorBit.LENGTH | ErrorBit.COMMAND, 0x11, 0x10, 0x05, 0x89)
    assert {
        "errors": [str(bit.name).lower() for bit in error.bits],
        "length": error.length,
        "command": error.command,
        "order": error.order,
        "checksum": error.checksum,
    } == vector.decoded


@pytest.mark.parametrize(
    ("raw", "bit"),
    [(0x01, ErrorBit.LENGTH), (0x02, ErrorBit.COMMAND), (0x04, ErrorBit.ORDER), (0x08, ErrorBit.CHECKSUM)],
)
def test_each_error_has_the_documents_bit(raw: int, bit: ErrorBit) -> None:
    assert parse_error(Frame(Code.ERROR, raw, bytes(4))).bits == bit


@pytest.mark.parametrize("bits", range(256))
def test_any_error_bits_may_stand_in_the_orders_place(bits: int) -> None:
    assert parse_error(Frame(Code.ERROR, bits, bytes(4))).bits == bits


@pytest.mark.parametrize("frame", [Frame(0x1F, 3, bytes(3)), Frame(0x1F, 3, bytes(5)), Frame(0x03, 3, bytes(4))])
def test_an_error_frame_of_another_shape_is_refused(frame: Frame) -> None:
    with pytest.raises(ProtocolError, match=r"expected command 0x1F, order 0x03, 4 data bytes; got command"):
        parse_error(frame)
