"""What counts as an answer: hand-written bytes in, readings and reasons out."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.devices.dialogue import REQUESTS, SILENCE, Dialogue, Heard
from orchestrator.model import ChargeMode, ChargerReading, Connection, ControlMode, Operation, Precharge


def frame(*counted: int) -> bytes:
    """Address to data, with start, checksum and end around them (protocol 2/2, §3.1)."""
    return bytes((0xAF, 0xFA, *counted, sum(counted) & 0xFF, 0xAF, 0xA0))


# 50.11 V, 23.11 A, (no temperatures), manual; running, step 2, charge, precharge off, connected
VOLTS_AMPS = (0x13, 0x93, 0x09, 0x07)
REST = (0, 1, 0, 1, 0, 2, 0, 4, 0, 0, 0, 1)
REPLY = frame(0x90, 0x13, 0x03, 0x90, *VOLTS_AMPS, *REST)
REPLY_9 = frame(0x90, 0x15, 0x03, 0x90, *VOLTS_AMPS, 0, 0, *REST)
REPLY_10 = frame(0x90, 0x17, 0x03, 0x90, *VOLTS_AMPS, 0, 0, 0, 0, *REST)
ASK = frame(0x90, 0x05, 0x01, 0x90, 0x13, 0x1F)
ASK_9 = frame(0x90, 0x05, 0x01, 0x90, 0x17, 0x1F)
ASK_10 = frame(0x90, 0x05, 0x01, 0x90, 0x1F, 0x1F)
STOP = frame(0x90, 0x04, 0x10, 0x90, 0x00)
CHECKSUM_ERROR = frame(0x90, 0x07, 0x1F, 0x08, 0x05, 0x01, 0x90, 0x2D)

READING = ChargerReading(
    5.0,
    50.11,
    23.11,
    ControlMode.MANUAL,
    Operation.RUNNING,
    2,
    ChargeMode.CHARGE,
    Precharge.OFF,
    Connection.NORMAL,
)


@pytest.fixture
def dialogue() -> Dialogue:
    return Dialogue()


def test_the_request_is_the_documented_frame_for_eight_values(dialogue: Dialogue) -> None:
    assert dialogue.ask(5.0) == ASK
    assert dialogue.missing == 25


def test_the_answer_is_a_reading_of_the_time_of_its_request(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    assert dialogue.hear(REPLY, 5.03) == READING


def test_the_answer_may_come_byte_by_byte(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    heard = []
    for at, byte in enumerate(REPLY):
        assert dialogue.missing == len(REPLY) - at
        heard.append(dialogue.hear(bytes((byte,)), 5.03))
    assert heard[:-1] == [None] * 24
    assert heard[-1] == READING
    assert dialogue.missing == 0


@pytest.mark.parametrize(
    "before",
    [
        ASK,  # an echo
        STOP,  # an echo of the previous command
        frame(0x90, 0x05, 0x02, 0x90, 0x01, 0x01),  # an acknowledgement in no document
        frame(0x90, 0x03, 0x55, 0x90),  # a command in no document
        CHECKSUM_ERROR,
        bytes(40),
        b"\xaf\xfa\x90\x13\x03\x90\xaf",
        REPLY[:-4],
        REPLY_10,
    ],
    ids=lambda before: before.hex(),
)
def test_the_answer_is_found_behind(dialogue: Dialogue, before: bytes) -> None:
    dialogue.ask(5.0)
    assert (dialogue.hear(before + REPLY, 5.03) or dialogue.give_up(5.12)) == READING


def test_an_answer_behind_a_false_start_is_found_when_time_is_up(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    assert dialogue.hear(b"\xaf\xfa\x90\x23" + REPLY, 5.03) is None  # this start claims 41 bytes
    assert dialogue.give_up(5.12) == READING
    assert dialogue.heard is Heard.NOTHING


def test_what_follows_the_answer_is_heard_too(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    assert dialogue.hear(REPLY + CHECKSUM_ERROR, 5.03) == READING
    assert (dialogue.error_bits, dialogue.error_t_s) == (8, 5.03)


def test_an_answer_counts_once(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    assert dialogue.hear(REPLY, 5.03) == READING
    assert dialogue.hear(REPLY, 5.04) is None


def test_nobody_asked(dialogue: Dialogue) -> None:
    assert dialogue.hear(REPLY, 5.0) is None
    dialogue.ask(5.1)
    assert dialogue.give_up(5.22) is None


def test_what_comes_after_time_is_up_answers_nothing_in_whatever_form(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    assert dialogue.give_up(5.12) is None
    assert dialogue.hear(REPLY + REPLY_9 + REPLY_10, 5.15) is None


def test_half_an_answer_from_before_the_request_answers_nothing(dialogue: Dialogue) -> None:
    dialogue.hear(REPLY[:12], 5.0)
    dialogue.ask(5.1)
    assert dialogue.hear(REPLY[12:], 5.12) is None
    assert dialogue.give_up(5.22) is None


def test_an_error_frame_behind_a_false_start_before_the_request_is_heard(dialogue: Dialogue) -> None:
    dialogue.hear(b"\xaf\xfa\x90\x23" + CHECKSUM_ERROR, 5.0)
    dialogue.ask(5.1)
    assert (dialogue.error_bits, dialogue.error_t_s) == (8, 5.1)


# --- late answers ----------------------------------------------------------------------------------------------------


def test_after_a_miss_another_number_of_values_is_asked_for(dialogue: Dialogue) -> None:
    asked = []
    for t_s in (5.0, 5.2, 5.4, 5.6):
        asked.append(dialogue.ask(t_s))
        assert dialogue.give_up(t_s + 0.12) is None
    assert asked == [ASK, ASK_9, ASK_10, ASK]


def test_a_charger_that_is_always_late_is_never_taken_for_a_prompt_one(dialogue: Dialogue) -> None:
    """Each answer comes 30 ms into the next request and looks as fresh as any."""
    dialogue.ask(5.0)
    assert dialogue.give_up(5.12) is None
    for t_s, late in ((5.2, REPLY), (5.4, REPLY_9), (5.6, REPLY_10), (5.8, REPLY)):
        dialogue.ask(t_s)
        assert dialogue.hear(late, t_s + 0.03) is None
        assert dialogue.give_up(t_s + 0.12) is None
    assert dialogue.heard is Heard.LATE_REPLY


@pytest.mark.parametrize(("misses", "reply"), [(0, REPLY), (1, REPLY_9), (2, REPLY_10), (3, REPLY)])
def test_every_form_of_the_request_gives_the_same_reading(dialogue: Dialogue, misses: int, reply: bytes) -> None:
    for _ in range(misses):
        dialogue.ask(4.0)
        dialogue.give_up(4.12)
    dialogue.ask(5.0)
    assert dialogue.missing == len(reply)
    assert dialogue.hear(reply, 5.03) == READING


def test_an_answered_request_is_asked_in_the_same_form_again(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    dialogue.give_up(5.12)
    dialogue.ask(5.2)
    dialogue.hear(REPLY_9, 5.23)
    assert dialogue.ask(5.4) == ASK_9


# --- error frames and what is said of silence ------------------------------------------------------------------------


def test_an_error_frame_is_remembered_and_does_not_end_the_wait(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    assert dialogue.hear(CHECKSUM_ERROR, 5.02) is None
    assert (dialogue.error_bits, dialogue.error_t_s) == (8, 5.02)
    assert dialogue.hear(REPLY, 5.05) == READING


def test_an_error_frame_of_another_form_says_nothing(dialogue: Dialogue) -> None:
    dialogue.hear(frame(0x90, 0x04, 0x1F, 0x08, 0x05), 5.0)
    assert (dialogue.error_bits, dialogue.error_t_s, dialogue.heard) == (0, None, Heard.NOTHING)


@pytest.mark.parametrize(
    ("came", "heard"),
    [
        (b"", Heard.NOTHING),
        (ASK, Heard.NOTHING),
        (bytes(3), Heard.NOISE),
        (REPLY[:-1] + b"\x00", Heard.NOISE),
        (CHECKSUM_ERROR, Heard.ERROR_FRAME),
        (CHECKSUM_ERROR + bytes(3), Heard.ERROR_FRAME),
        (REPLY_9, Heard.LATE_REPLY),
        (REPLY_9 + CHECKSUM_ERROR, Heard.LATE_REPLY),
    ],
)
def test_silence_is_told_by_what_was_heard_instead(dialogue: Dialogue, came: bytes, heard: Heard) -> None:
    dialogue.ask(5.0)
    assert dialogue.hear(came, 5.03) is None
    assert dialogue.give_up(5.12) is None
    assert dialogue.heard is heard
    assert heard in SILENCE


def test_a_good_answer_clears_what_was_heard(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    dialogue.hear(bytes(3) + CHECKSUM_ERROR, 5.03)
    dialogue.give_up(5.12)
    dialogue.ask(5.2)
    dialogue.hear(REPLY_9, 5.23)
    assert dialogue.heard is Heard.NOTHING
    dialogue.ask(5.4)
    dialogue.give_up(5.52)
    assert dialogue.heard is Heard.NOTHING


def test_bad_frames_are_counted(dialogue: Dialogue) -> None:
    dialogue.ask(5.0)
    assert dialogue.hear(REPLY[:-3] + bytes(3) + REPLY, 5.03) == READING
    assert dialogue.bad_frames == 1


PIECES = st.binary(max_size=20) | st.sampled_from([ASK, STOP, REPLY_9, CHECKSUM_ERROR, REPLY[:9], b"\xaf\xfa\x90\x23"])


@given(st.lists(PIECES, max_size=12))
def test_a_reading_never_comes_of_anything_but_the_answer(pieces: list[bytes]) -> None:
    dialogue = Dialogue()
    dialogue.ask(5.0)
    came = b"".join(pieces)
    heard = [dialogue.hear(piece, 5.03) for piece in pieces] + [dialogue.give_up(5.12)]
    if REPLY not in came:
        assert heard == [None] * len(heard)
        assert dialogue.ask(5.2) == ASK_9


def test_all_requests_are_answered_in_different_lengths() -> None:
    assert len({kind1.bit_count() + kind2.bit_count() for kind1, kind2 in REQUESTS}) == len(REQUESTS) == 3
