"""What the lines do to frames: at the configured rates, and reproducibly with the same seed."""

import pytest

from orchestrator.sim.line import LINES, Noise, SimulatedLine

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
    line = SimulatedLine(loss=0.5, garbage=0.5, seed=7)
    first, second = Noise(line), Noise(line)
    assert [first.spoil(FRAME) for _ in range(50)] == [second.spoil(FRAME) for _ in range(50)]


def test_the_poor_line_loses_one_frame_in_a_hundred_and_changes_a_byte_in_one_of_a_thousand() -> None:
    noise = Noise(LINES["poor"])
    heard = [noise.spoil(FRAME) for _ in range(20_000)]
    assert 150 <= heard.count(b"") <= 250
    changed = [frame for frame in heard if frame not in (FRAME, b"")]
    assert 10 <= len(changed) <= 30
    assert all(sum(a != b for a, b in zip(frame, FRAME, strict=True)) == 1 for frame in changed)
