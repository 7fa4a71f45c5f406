"""The frame codec: golden bytes both ways, every kind of damage, and agreement with an independent decoder."""

import random
from collections.abc import Callable, Iterable
from itertools import pairwise

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from orchestrator.protocol.frame import (
    ADDRESS,
    END,
    MAX_DATA,
    MAX_FRAME,
    START,
    Frame,
    FrameDecoder,
    checksum,
    declared_size,
    why_bad,
)
from tests.protocol.reference import frames_in, good_frame_at
from tests.protocol.streams import RUN, STOP, damaged_frames, frames, streams
from tests.protocol.vectors import CHARGER, GOOD, ChargerVector


def fed(decoder: FrameDecoder, parts: Iterable[bytes]) -> list[bytes]:
    return [frame.encode() for part in parts for frame in decoder.feed(part)]


def waiting(decoder: FrameDecoder) -> int:
    """The number of bytes waiting for the rest of their frame."""
    return len(decoder._pending)


def all_of(stream: bytes) -> list[bytes]:
    """Everything found in a stream followed by silence."""
    decoder = FrameDecoder()
    return fed(decoder, [stream]) + [frame.encode() for frame in decoder.flush()]


# --- golden bytes ----------------------------------------------------------------------------------------------------


def bytewise(wire: bytes) -> list[bytes]:
    return [wire[at : at + 1] for at in range(len(wire))]


ARRIVALS: dict[str, Callable[[bytes], list[bytes]]] = {
    "whole": lambda wire: [wire],
    "bytewise": bytewise,
    "after noise": lambda wire: [b"\x00\xff\xafAF FA", wire],
    "after half a start": lambda wire: [b"\xaf" + wire],
    "after a false start": lambda wire: [b"\xaf\xfa" + wire],
    "after a cut frame": lambda wire: [STOP[:6] + wire, bytes(8)],
    "before other bytes": lambda wire: [wire + b"\xaf\x90\x00"],
    "between other bytes, bytewise": lambda wire: bytewise(b"\xaf\xa0\xaf\xaf\xfa\x00" + wire + b"\xaf\xfa"),
}


@pytest.mark.parametrize("arrival", ARRIVALS)
@pytest.mark.parametrize("vector", CHARGER, ids=str)
def test_golden_frames_are_found_however_they_arrive(vector: ChargerVector, arrival: str) -> None:
    decoder = FrameDecoder()
    assert fed(decoder, ARRIVALS[arrival](vector.wire)) == ([vector.wire] if vector.valid else [])
    assert waiting(decoder) <= 8


@pytest.mark.parametrize("vector", GOOD, ids=str)
def test_golden_frames_are_built(vector: ChargerVector) -> None:
    wire = vector.wire
    assert Frame(wire[4], wire[5], wire[6:-3]).encode() == wire
    assert str(Frame(wire[4], wire[5], wire[6:-3])) == wire.hex(" ").upper()


def test_the_documents_misprinted_frame_is_a_bad_frame_like_any_other() -> None:
    decoder = FrameDecoder()
    assert decoder.feed(bytes.fromhex("AFFA90071F031110058939AFA0")) == []
    assert decoder.bad_frames == 1


@pytest.mark.parametrize("data", [START, END, START + END, STOP, b"\xaf" * 32, (START + b"\x90\x23") * 8])
def test_starts_ends_and_whole_frames_inside_data_do_not_split_a_frame(data: bytes) -> None:
    wire = Frame(0x03, ADDRESS, data).encode()
    for parts in ([wire], bytewise(wire), [b"\xaf\xfa\x90\x02", wire]):
        assert fed(FrameDecoder(), parts) == [wire]


def test_the_carry_of_the_sum_is_dropped() -> None:
    assert checksum(bytes([0x90, 0x05, 0x01, 0x90, 0x03, 0x04])) == 0x2D
    assert checksum(b"") == 0


@pytest.mark.parametrize(
    ("command", "order", "data"),
    [(-1, 0, b""), (256, 0, b""), (0, -1, b""), (0, 256, b""), (3, 0x90, bytes(MAX_DATA + 1))],
)
def test_a_frame_that_cannot_be_sent_cannot_be_made(command: int, order: int, data: bytes) -> None:
    with pytest.raises(ValueError, match="no frame can carry"):
        Frame(command, order, data)


@pytest.mark.parametrize("data", [b"", bytes(MAX_DATA)])
def test_the_smallest_and_the_largest_frame_are_good(data: bytes) -> None:
    wire = Frame(0x03, ADDRESS, data).encode()
    assert declared_size(wire) == len(wire) == len(data) + 9
    assert why_bad(wire) == ""


# --- damage ----------------------------------------------------------------------------------------------------------

DAMAGE = [
    (RUN[:2] + b"\x91" + RUN[3:], "address 0x91, expected 0x90"),
    (
        bytes.fromhex("AFFA9105029001012AAFA0"),  # its sum is right
        "address 0x91, expected 0x90",
    ),
    (RUN[:3] + b"\x02" + RUN[4:], "length 0x02, expected 0x03 … 0x23"),
    (RUN[:3] + b"\x24" + RUN[4:], "length 0x24, expected 0x03 … 0x23"),
    (RUN[:8] + b"\x2a" + RUN[9:], "checksum 0x2A, expected 0x29"),
    (RUN[:9] + b"\xaa" + RUN[10:], "end AA A0, expected AF A0"),
    (RUN[:10] + b"\xaa", "end AF AA, expected AF A0"),
    (
        RUN[:3] + b"\x04" + RUN[4:],
        "checksum 0x01, expected 0x27; end 29 AF, expected AF A0",
    ),
]


@pytest.mark.parametrize(("bad", "why"), DAMAGE)
def test_a_damaged_frame_is_dropped_and_says_what_was_expected(bad: bytes, why: str) -> None:
    for parts in ([bad, STOP], bytewise(bad + STOP)):
        decoder = FrameDecoder()
        assert fed(decoder, parts) == [STOP]
        assert (decoder.bad_frames, decoder.skipped_bytes, waiting(decoder)) == (1, len(bad), 0)
    assert why_bad(bad) == why


@pytest.mark.parametrize(
    ("head", "why"),
    [
        ("AF FA 91", "address 0x91, expected 0x90"),
        ("AF FA 90 02", "length 0x02, expected 0x03 … 0x23"),
        ("AF FA 90 24", "length 0x24, expected 0x03 … 0x23"),
    ],
)
def test_a_start_with_a_wrong_address_or_length_is_not_waited_for(head: str, why: str) -> None:
    decoder = FrameDecoder()
    assert decoder.feed(bytes.fromhex(head)) == []
    assert (waiting(decoder), decoder.bad_frames) == (0, 1)
    assert why_bad(bytes.fromhex(head)) == why


@pytest.mark.parametrize(
    ("cut", "why"),
    [
        (START, "incomplete: 2 bytes, the smallest frame has 9"),
        (START + b"\x90", "incomplete: 3 bytes, the smallest frame has 9"),
        (RUN[:4], "incomplete: 4 bytes, its length 0x05 makes it 11"),
        (RUN[:-1], "incomplete: 10 bytes, its length 0x05 makes it 11"),
    ],
)
def test_an_incomplete_frame_waits_until_the_line_is_quiet(cut: bytes, why: str) -> None:
    decoder = FrameDecoder()
    assert decoder.feed(cut) == []
    assert (waiting(decoder), decoder.bad_frames) == (len(cut), 0)
    assert decoder.flush() == []
    assert (waiting(decoder), decoder.bad_frames, decoder.skipped_bytes) == (0, 1, len(cut))
    assert why_bad(cut) == why
    assert fed(decoder, [RUN]) == [RUN]


def test_a_good_frame_inside_a_waiting_false_start_comes_out_with_the_flush() -> None:
    false_start = bytes.fromhex("AFFA9023")  # claims 41 bytes
    decoder = FrameDecoder()
    assert decoder.feed(false_start + STOP + RUN + false_start) == []
    assert [frame.encode() for frame in decoder.flush()] == [STOP, RUN]
    assert (waiting(decoder), decoder.bad_frames, decoder.skipped_bytes) == (0, 2, 8)


def test_a_good_frame_inside_a_false_start_comes_out_as_soon_as_that_is_whole() -> None:
    decoder = FrameDecoder()
    assert decoder.feed(bytes.fromhex("AFFA9023") + STOP + bytes(26)) == []
    assert [frame.encode() for frame in decoder.feed(b"\x00")] == [STOP]


def test_half_a_start_is_kept_for_the_next_bytes_but_not_past_a_flush() -> None:
    decoder = FrameDecoder()
    assert decoder.feed(RUN + b"\xaf") != []
    assert waiting(decoder) == 1
    assert fed(decoder, [RUN[1:]]) == [RUN]
    assert decoder.feed(b"\xaf") == []
    assert decoder.flush() == []
    assert fed(decoder, [RUN[1:]]) == []


def test_a_hundred_kilobytes_of_the_worst_garbage_stay_bounded() -> None:
    decoder = FrameDecoder()
    for _ in range(1000):
        decoder.feed(bytes.fromhex("AFFA9023") * 25)
        assert waiting(decoder) < MAX_FRAME
    assert [frame.encode() for frame in decoder.feed(STOP + bytes(MAX_FRAME))] == [STOP]


# --- any bytes -------------------------------------------------------------------------------------------------------

cuts = st.lists(st.integers(0, 300), max_size=12)


def split(stream: bytes, at: list[int]) -> list[bytes]:
    edges = [0, *sorted(at), len(stream)]
    return [stream[start:end] for start, end in pairwise(edges)]


@given(streams, cuts)
@example(bytes.fromhex("AFFA9023") + STOP, [7])
def test_any_stream_gives_the_frames_that_the_reference_finds(stream: bytes, cut: list[int]) -> None:
    decoder = FrameDecoder()
    found = []
    parts = split(stream, cut)
    for part in parts:
        found += [frame.encode() for frame in decoder.feed(part)]
        assert waiting(decoder) < MAX_FRAME
    came = sum(map(len, parts))
    assert sum(map(len, found)) + decoder.skipped_bytes + waiting(decoder) == came
    found += [frame.encode() for frame in decoder.flush()]
    assert found == frames_in(b"".join(parts))
    assert (waiting(decoder), sum(map(len, found)) + decoder.skipped_bytes) == (0, came)


@given(st.lists(st.tuples(st.binary(max_size=30).filter(lambda noise: 0xAF not in noise), frames), max_size=8))
def test_no_good_frame_is_lost_in_noise_without_starts(mix: list[tuple[bytes, bytes]]) -> None:
    stream = b"".join(noise + frame for noise, frame in mix)
    assert fed(FrameDecoder(), bytewise(stream)) == [frame for _, frame in mix]


@given(st.integers(3, 35), st.binary(max_size=30).filter(lambda noise: 0xAF not in noise), st.lists(frames, max_size=4))
def test_no_good_frame_is_lost_behind_or_inside_a_false_start(length: int, noise: bytes, good: list[bytes]) -> None:
    stream = START + bytes([ADDRESS, length]) + noise + b"".join(good)
    assume(not good_frame_at(stream, 0))  # noise that happens to be a whole frame is a frame
    assert all_of(stream) == good


@given(st.one_of(frames, damaged_frames, st.binary(max_size=60).map(START.__add__)))
def test_why_bad_agrees_with_the_decoder(candidate: bytes) -> None:
    assume(candidate.startswith(START))
    size = declared_size(candidate)
    good = size is not None and frames_in(candidate)[:1] == [candidate[:size]]
    assert (why_bad(candidate) == "") == good


def test_a_lossy_line_loses_only_the_frames_that_it_hit() -> None:
    """One byte in a hundred is lost or doubled; exactly the intact frames are found."""
    chance = random.Random(1)
    whole, stream = [], bytearray()
    for _ in range(400):
        frame = Frame(0x03, ADDRESS, chance.randbytes(16)).encode()
        copies = [chance.choice((0, 2)) if chance.random() < 0.01 else 1 for _ in frame]
        damaged = b"".join(bytes((byte,)) * count for byte, count in zip(frame, copies, strict=True))
        whole += [frame] if frame in damaged else []  # a doubled first AF or last A0 does no harm
        stream += damaged
    assert 300 < len(whole) < 330
    assert all_of(bytes(stream)) == whole
