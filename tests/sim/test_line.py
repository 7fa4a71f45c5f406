"""What the lines do to frames: as often as they say, and always the same with the same seed."""

import pytest

from orchestrator.sim.line import LINES, Line, Noise

FRAME = bytes(range(20))


@pytest.mark.parametrize("name", ["perfect", "real", "bytewise", "delayed", "echo"])
def test_most_lines_leave_frames_alone(name: str) -> None:
    noise = Noise(LINES[name])
    assert all(noise.spoil(FRAME) == FRAME for _ in range(100))


def test_the_lossy_line_loses_one_byte_of_one_frame_in_twenty() -> None:
    noise = Noise(LINES["lossy"])
    spoilt = [frame for frame in (noise.spoil(FRAME) for _ in range(2000)) if frame != FRAME]
    assert 60 <= len(spoilt) <= 140
    assert {len(frame) for frame in spoilt} == {19}


def test_the_garbage_line_puts_rubbish_before_every_other_frame() -> None:
    noise = Noise(LINES["garbage"])
    heard = [noise.spoil(FRAME) for _ in range(400)]
    assert all(frame.endswith(FRAME) for frame in heard)
    assert 150 <= sum(frame != FRAME for frame in heard) <= 250
    assert any(frame.startswith(b"\xaf\xfa") for frame in heard)


def test_the_same_seed_spoils_the_same_frames() -> None:
    line = Line(loss=0.5, garbage=0.5, seed=7)
    first, second = Noise(line), Noise(line)
    assert [first.spoil(FRAME) for _ in range(50)] == [second.spoil(FRAME) for _ in range(50)]
