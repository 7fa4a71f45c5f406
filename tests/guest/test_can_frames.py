"""Frames on the kernel's own CAN: what its filter lets through to us, and whose they are."""

from collections.abc import Iterator

import can
import pytest

from orchestrator.link.can import CanBus
from tests.guest.stage import socketcan, vcan

READ = bytes.fromhex("40 00 60 00 00 00 00 00")
ANSWER = bytes.fromhex("43 00 60 00 F8 FF 40 09")
OURS = (0x590, 0x610, 0x710)
NAME = "vcan7"


@pytest.fixture
def other() -> Iterator[can.BusABC]:
    """Another program on this machine."""
    with vcan(NAME), can.Bus(**socketcan(NAME)) as bus:
        yield bus


def opened(heard: list[tuple[int, bytes]], **keys: object) -> CanBus:
    bus = CanBus("can0", {**socketcan(NAME), **keys}, [0x10])
    for cob_id in OURS:
        bus.subscribe(cob_id, lambda cob_id, data: heard.append((cob_id, data)))
    bus.open()
    return bus


def say(other: can.BusABC, cob_id: int, data: bytes, **kind: bool) -> None:
    other.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=kind.pop("extended", False), **kind))


def taken(bus: CanBus) -> list[tuple[int, bytes]]:
    """All that the kernel has let through."""
    frames = bus._frames
    assert frames is not None
    return [frames.frame(one) for one in frames.take(0.1, 0.05)]


def test_frames_of_another_program_on_this_machine_are_heard_and_ours_are_not(other: can.BusABC) -> None:
    heard: list[tuple[int, bytes]] = []
    bus = opened(heard)
    bus.send(0x610, READ)
    asked = other.recv(1.0)
    assert asked is not None and bytes(asked.data) == READ
    say(other, 0x610, READ)
    say(other, 0x590, ANSWER)
    bus.receive(1.0, 0.05)
    assert heard == [(0x610, READ), (0x590, ANSWER)]
    bus.close()


def test_nothing_but_what_is_subscribed_to_comes_out_of_the_kernel(other: can.BusABC) -> None:
    bus = opened([])
    for cob_id in range(0x800):
        if cob_id not in OURS:
            say(other, cob_id, bytes(8))
    say(other, 0x590, ANSWER, extended=True)
    say(other, 0x590, b"", is_remote_frame=True)
    say(other, 0x590, ANSWER)
    assert taken(bus) == [(0x590, ANSWER)]
    bus.close()


def test_the_station_files_own_filters_hold_instead(other: can.BusABC) -> None:
    bus = opened([], can_filters=[{"can_id": 0x580, "can_mask": 0x7E0}])
    for cob_id in (0x590, 0x59F, 0x710):
        say(other, cob_id, ANSWER)
    assert [cob_id for cob_id, _ in taken(bus)] == [0x590, 0x59F]
    bus.close()
