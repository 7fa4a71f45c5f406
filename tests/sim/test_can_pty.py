"""The emulated bus without a network, against python-can's own `serial` interface at the other end."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.sim.can_pty import PtyBus
from tests.waiting import wait_until

Ends = tuple[PtyBus, can.BusABC]


@pytest.fixture(name="ends", scope="module")
def _ends(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ends]:
    path = str(tmp_path_factory.mktemp("bus") / "can0")
    ours = PtyBus(path)
    keys: dict[str, Any] = {"interface": "serial", "channel": path, "bitrate": 250_000, "timeout": 1.0}
    theirs = can.Bus(ignore_config=True, **keys)
    yield ours, theirs
    theirs.shutdown()
    ours.shutdown()
    ours.shutdown()  # twice is as good
    assert not os.path.lexists(path)


def next_of(bus: PtyBus) -> can.Message:
    heard: list[can.Message] = []

    def look() -> bool:
        if (message := bus.recv(0)) is not None:
            heard.append(message)
        return bool(heard)

    wait_until(look, what="a frame", every_s=0.0005)
    return heard[0]


FRAMES = st.builds(
    lambda can_id, extended, remote, data: can.Message(
        arbitration_id=can_id if extended else can_id & 0x7FF,
        is_extended_id=extended,
        is_remote_frame=remote,
        data=b"" if remote else data,
    ),
    st.integers(0, 0x1FFFFFFF),
    st.booleans(),
    st.booleans(),
    st.binary(max_size=8),
)


@given(FRAMES)
def test_every_frame_arrives_as_it_was_sent_both_ways(ends: Ends, frame: can.Message) -> None:
    ours, theirs = ends
    ours.send(frame)
    there = theirs.recv(1.0)
    assert there is not None and there.equals(frame, timestamp_delta=None, check_channel=False, check_direction=False)
    theirs.send(frame)
    back = next_of(ours)
    assert back.equals(frame, timestamp_delta=None, check_channel=False, check_direction=False)


def test_it_has_a_descriptor_for_an_event_loop_and_never_waits(ends: Ends) -> None:
    assert os.isatty(ends[0].fileno())
    assert ends[0].recv(0) is None


@pytest.mark.parametrize(
    "noise", [b"\x00", b"\xbb\xbb", b"\xaa\0\0\0\0\x09", b"\xaa\0\0\0\0\x01\x10\0\0\0\x55\x00", b"\xaa"], ids=range(5)
)
def test_rubbish_is_passed_over(tmp_path: Path, noise: bytes) -> None:
    bus = PtyBus(str(tmp_path / "can0"))
    other = os.open(tmp_path / "can0", os.O_RDWR | os.O_NOCTTY)
    try:
        frame = b"\xaa\0\0\0\0\x02\x90\x05\0\0\x01\x02\xbb"
        os.write(other, noise + frame * 3)
        got = next_of(bus)
        assert (got.arbitration_id, bytes(got.data)) == (0x590, b"\x01\x02")
    finally:
        os.close(other)
        bus.shutdown()


def test_a_bus_that_nobody_reads_loses_frames_and_says_so(tmp_path: Path) -> None:
    bus = PtyBus(str(tmp_path / "can0"))
    frame = can.Message(arbitration_id=0x190, data=bytes(8), is_extended_id=False)
    try:
        with pytest.raises(can.CanError):
            for _ in range(100_000):
                bus.send(frame)
    finally:
        bus.shutdown()
