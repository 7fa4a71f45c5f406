"""The last-resort bytes match the document, and only a good answer to their own poll proves standby."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.model import Action, Command, ControlMode
from orchestrator.protocol import charger, standby
from orchestrator.protocol.charger import Kind1, Kind2, encode, status_request
from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.charger_frames import Kind, status
from tests.protocol.streams import streams

ASKED = (Kind1.CURRENT | Kind1.CONTROL_MODE, int(Kind2.OPERATION))


def answer(amps: float, operation: int, kinds: tuple[int, int] = ASKED) -> bytes:
    """As sent by the emulated charger."""
    return status(SimulatedCharger(), *kinds, {Kind.CURRENT: round(100 * amps), Kind.OPERATION: operation})


def test_the_frames_are_those_of_the_codec() -> None:
    assert standby.STOP_FRAME == charger.STOP_FRAME
    assert standby.OPERATION_STOP_FRAME == charger.OPERATION_STOP_FRAME
    assert status_request(*ASKED) == standby.QUESTION
    assert len(answer(0, 0)) == standby.ANSWER_BYTES


def test_the_question_is_three_bytes_away_from_every_command() -> None:
    commands = [Command(action, value) for action in Action for value in range(6)]
    for command in commands:
        try:
            frame = encode(command)
        except ValueError:
            continue  # no such command
        if len(frame) == len(standby.QUESTION):
            assert sum(a != b for a, b in zip(frame, standby.QUESTION, strict=True)) >= 3


@pytest.mark.parametrize(
    ("amps", "operation", "said"),
    [
        *((0, 0, True), (0.5, 0, True), (0.51, 0, False), (14, 1, False), (0, 1, False), (0, 2, False)),
        *((2.56, 0, False), (655.35, 0, False), (0, 0x100, False)),  # the high bytes count as well
    ],
)
def test_standby_is_operation_0_and_no_current(amps: float, operation: int, said: bool) -> None:
    assert standby.stands_by(answer(amps, operation)) is said


@pytest.mark.parametrize("mode", ControlMode)
def test_the_control_mode_is_no_matter(mode: ControlMode) -> None:
    assert standby.stands_by(status(SimulatedCharger(mode), *ASKED, {Kind.OPERATION: 0})) is True


@pytest.mark.parametrize("kinds", [(0x13, 0x1F), (0x17, 0x1F), (0x1F, 0x1F), (0x02, 0x01), (0x13, 0x01)])
def test_the_answer_to_another_question_says_nothing(kinds: tuple[int, int]) -> None:
    assert standby.stands_by(answer(0, 0, kinds)) is None


def test_the_newest_answer_counts() -> None:
    assert standby.stands_by(answer(0, 0) + answer(14, 1)) is False
    assert standby.stands_by(answer(14, 1) + answer(0, 0)) is True
    assert standby.stands_by(answer(14, 1) + answer(0, 0)[:-1]) is False
    assert standby.stands_by(answer(14, 1) + answer(0, 0) + answer(14, 1)[:-1]) is True


@given(streams, streams)
def test_an_answer_is_found_in_noise(before: bytes, after: bytes) -> None:
    assert standby.stands_by(before + answer(0, 0) + after) is True


@given(st.integers(0, len(answer(0, 0)) - 1), st.integers(1, 255))
def test_a_damaged_answer_says_nothing(at: int, damage: int) -> None:
    spoilt = bytearray(answer(0, 0))
    spoilt[at] ^= damage
    assert standby.stands_by(bytes(spoilt)) is None


@given(st.binary(max_size=64))
def test_noise_says_nothing(noise: bytes) -> None:
    assert standby.stands_by(noise) is None
