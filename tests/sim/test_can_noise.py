"""What buses do to frames: at the configured rates, and reproducibly with the same seed."""

import can

from orchestrator.sim.can_noise import BUSES, Bus, BusNoise

FRAME = can.Message(arbitration_id=0x590, data=range(8), is_extended_id=False)


def test_a_perfect_bus_leaves_frames_alone() -> None:
    noise = BusNoise(BUSES["perfect"])
    assert all(noise.spoil(FRAME) is FRAME for _ in range(100))


def test_a_poor_bus_loses_one_frame_in_a_hundred_and_damages_one_in_a_thousand() -> None:
    noise = BusNoise(BUSES["poor"])
    heard = [noise.spoil(FRAME) for _ in range(20_000)]
    assert 150 <= heard.count(None) <= 250
    assert 10 <= sum(message not in (FRAME, None) for message in heard) <= 30


def test_what_is_damaged_is_an_error_frame_or_cut_short_and_never_another_value() -> None:
    noise = BusNoise(Bus(damaged=1.0))
    heard = [noise.spoil(FRAME) for _ in range(100)]
    errors = [message for message in heard if message is not None and message.is_error_frame]
    cut = [message for message in heard if message is not None and not message.is_error_frame]
    assert len(errors) + len(cut) == 100
    assert len(errors) > 30
    assert len(cut) > 30
    assert all(message.arbitration_id == 0x590 and FRAME.data.startswith(message.data) for message in cut)
    assert all(len(message.data) < 8 for message in cut)


def test_the_same_seed_spoils_the_same_frames() -> None:
    first, second = BusNoise(Bus(lost=0.5, seed=7)), BusNoise(Bus(lost=0.5, seed=7))
    assert [first.spoil(FRAME) for _ in range(50)] == [second.spoil(FRAME) for _ in range(50)]
