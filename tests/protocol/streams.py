"""Hypothesis strategies for everything a serial line can deliver."""

from hypothesis import strategies as st

from orchestrator.protocol.frame import ADDRESS, END, MAX_DATA, START, Frame

STOP = bytes.fromhex("AFFA900410900034AFA0")
RUN = bytes.fromhex("AFFA90050290010129AFA0")

frames = st.builds(
    lambda command, order, data: Frame(command, order, data).encode(),
    st.integers(0, 255),
    st.sampled_from([ADDRESS, 0x03, 0xAF, 0xFA]),
    st.one_of(
        st.binary(max_size=MAX_DATA),
        st.lists(st.sampled_from([b"\xaf", START, END, b"\x90", b"\x03", STOP]), max_size=3).map(b"".join),
    ),
)


def with_byte(wire: bytes, at: int, byte: int, *, sum_mended: bool) -> bytes:
    """The frame with one byte replaced, possibly with a corrected checksum."""
    damaged = bytearray(wire)
    damaged[at % len(wire)] = byte
    if sum_mended:
        damaged[-3] = sum(damaged[2:-3]) & 0xFF
    return bytes(damaged)


damaged_frames = st.builds(with_byte, frames, st.integers(0, 40), st.integers(0, 255), sum_mended=st.booleans())

#: The parts of a stream: good frames, damaged and cut ones, false starts with or without a plausible header, noise.
fragments = st.one_of(
    frames,
    damaged_frames,
    st.tuples(frames, st.integers(1, 40)).map(lambda cut: cut[0][: cut[1]]),
    st.sampled_from([b"\xaf", START, END, b"\xaf\xfa\x90", b"\xaf\xfa\x90\x23", b"\xaf\xfa\x90\x03", b"\xaf\xaf\xfa"]),
    st.binary(max_size=8),
)
streams = st.one_of(st.binary(max_size=200), st.lists(fragments, max_size=12).map(b"".join))
