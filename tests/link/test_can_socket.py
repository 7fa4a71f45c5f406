"""Frames straight on a driver's socket: the bytes, what is not CANopen's, and what can break.

SocketCAN's own code runs on a pair of sockets, for machines whose kernel has no CAN; `tests/guest` has a real one.
"""

import socket
import struct
from collections.abc import Iterator

import can
import pytest
from can.interfaces.socketcan import socketcan
from can.interfaces.udp_multicast.utils import pack_message, unpack_message

from orchestrator.errors import LinkError
from orchestrator.link import can_text
from orchestrator.link.can import CanBus
from orchestrator.link.can_echo import marks
from orchestrator.link.can_frames import ERROR, EXTENDED, FOREIGN, OWN, REMOTE, Messages
from orchestrator.link.can_socket import MOST, Multicast, SocketCan, SocketFrames, socket_frames
from tests.core.said import raises
from tests.link.test_can import ANSWER, OTHER_READ, READ, Frames, message

SETTINGS: dict[str, object] = {"interface": "socketcan", "channel": "can0", "bitrate": 250_000}
REQUEST_BYTES = bytes.fromhex("10 06 00 00 08 00 00 00 40 00 60 00 00 00 00 00")
ANSWER_BYTES = bytes.fromhex("90 05 00 00 08 00 00 00 43 00 60 00 F8 FF 40 09")

Wired = tuple[CanBus, Frames, socket.socket]


def opened(settings: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> tuple[CanBus, socket.socket]:
    ours, wire = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    monkeypatch.setattr(socketcan, "create_socket", lambda: ours)
    monkeypatch.setattr(socketcan, "bind_socket", lambda _socket, _channel: None)
    bus = CanBus("can0", settings, [0x10])
    return bus, wire


@pytest.fixture
def wired(monkeypatch: pytest.MonkeyPatch) -> Iterator[Wired]:
    """Our bus, what it heard, and the other end of its wire."""
    bus, wire = opened(SETTINGS, monkeypatch)
    heard = Frames()
    for cob_id in (0x590, 0x610):
        bus.subscribe(cob_id, lambda cob_id, data: heard.append((cob_id, data)))
    bus.open()
    yield bus, heard, wire
    bus.close()
    wire.close()


def test_a_frame_each_way(wired: Wired) -> None:
    bus, heard, wire = wired
    bus.send(0x610, READ)
    assert wire.recv(100) == REQUEST_BYTES
    wire.send(ANSWER_BYTES)
    bus.receive(1.0)
    assert heard == [(0x590, ANSWER)]
    bus.receive(0.0)
    assert len(heard) == 1


def test_python_can_reads_what_we_write_and_writes_what_we_read() -> None:
    for length in range(9):
        one = message(0x610, READ[:length])
        ours = SocketCan().packed(0x610, READ[:length])
        assert socketcan.dissect_can_frame(ours) == (0x610, length, 0, READ[:length])
        assert SocketCan().unpacked(bytes(socketcan.build_can_frame(one))) == (0x610, READ[:length])
        theirs = unpack_message(Multicast().packed(0x610, READ[:length]), check=True)
        assert theirs.equals(one, timestamp_delta=None, check_direction=False)
        assert Multicast().unpacked(pack_message(one)) == (0x610, READ[:length])


def messages(interface: str) -> Messages:
    """python-can's way, of which only the reading is wanted."""
    return Messages(can.BusABC, message, marks=marks({"interface": interface}))  # type: ignore[arg-type]


#: Kinds of frames with our own id that are none of CANopen's, and the bit that says so.
KINDS = {
    "extended": (message(0x590, ANSWER, extended=True), EXTENDED),
    "remote": (message(0x590, b"", is_remote_frame=True), REMOTE),
    "error": (message(0x040, bytes(8), is_error_frame=True), ERROR),
    "fd": (message(0x590, ANSWER, is_fd=True), FOREIGN),
    "fd, long": (message(0x590, bytes(64), is_fd=True), FOREIGN),
}


@pytest.mark.parametrize(("one", "bit"), KINDS.values(), ids=KINDS)
def test_what_is_not_canopens_is_told_by_either_way(one: can.Message, bit: int) -> None:
    assert SocketCan().unpacked(bytes(socketcan.build_can_frame(one)))[0] & bit
    assert Multicast().unpacked(pack_message(one))[0] & bit
    assert messages("pcan").frame(one)[0] & (ERROR if bit == ERROR else FOREIGN)


def test_a_length_that_only_can_fd_has_is_not_canopens() -> None:
    dlc_15 = struct.pack("=IB2xB8s", 0x590, 8, 15, ANSWER)
    assert SocketCan().unpacked(dlc_15)[0] == FOREIGN


def test_what_is_not_canopens_does_not_disturb(wired: Wired) -> None:
    bus, heard, wire = wired
    for one, _bit in KINDS.values():
        if not one.is_error_frame:
            wire.send(socketcan.build_can_frame(one))
    wire.send(socketcan.build_can_frame(message(0x123, b"abc")))
    wire.send(ANSWER_BYTES)
    bus.receive(1.0)
    assert heard == [(0x590, ANSWER)]


def test_all_that_is_there_is_taken_at_once_and_not_without_end(wired: Wired) -> None:
    bus, heard, wire = wired
    for _ in range(5):
        wire.send(ANSWER_BYTES)
    bus.receive(1.0, 0.001)
    assert len(heard) == 5
    frames = SocketFrames(wire.dup().detach(), SocketCan())  # nobody waits at this end
    for number in range(MOST + 1):
        bus.send(0x610, READ)
        assert number or bus.trouble is None
    assert [len(frames.take(0.0, 0.0)), len(frames.take(0.0, 0.0))] == [MOST, 1]
    frames.close()


def test_bus_off_breaks_the_bus(wired: Wired) -> None:
    bus, _, wire = wired
    wire.send(struct.pack("=IB3x8s", ERROR | 0x040, 8, bytes(8)))
    with raises(LinkError, match="bus-off"):
        bus.receive(1.0)


def test_a_transmit_queue_that_is_full_is_an_absent_bmu(wired: Wired) -> None:
    bus, _, wire = wired
    for _ in range(10_000):  # nobody takes them
        bus.send(0x610, READ)
        if bus.trouble:
            break
    assert bus.trouble == can_text.QUEUE_FULL
    wire.send(ANSWER_BYTES)
    bus.receive(1.0)
    assert bus.trouble is None


def test_what_we_sent_comes_back_only_where_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    bus, wire = opened(SETTINGS | {"receive_own_messages": True}, monkeypatch)
    heard = Frames()
    bus.subscribe(0x610, lambda cob_id, data: heard.append((cob_id, data)))
    bus.open()
    bus.send(0x610, READ)
    wire.send(wire.recv(100))  # the kernel's echo
    wire.send(REQUEST_BYTES)  # another master asks the same
    wire.send(SocketCan().packed(0x610, OTHER_READ))
    bus.receive(1.0)
    assert heard == [(0x610, READ), (0x610, OTHER_READ)]
    bus.close()


def test_a_frame_of_another_program_on_this_machine_is_not_ours() -> None:
    """SocketCAN marks it as sent, and so does every frame on a virtual interface."""
    theirs = message(0x590, ANSWER, is_rx=False)
    heard = {interface: messages(interface).frame(theirs) for interface in ("socketcan", "pcan")}
    assert heard == {"socketcan": (0x590, ANSWER), "pcan": (OWN | 0x590, ANSWER)}


def test_the_driver_keeps_what_only_it_can_do(wired: Wired) -> None:
    driver = wired[0]._bus
    assert driver is not None
    kept: list[dict[str, object]] = [
        {"interface": "slcan", "channel": "/dev/ttyACM0"},
        {"interface": "socketcan", "channel": ""},  # any of several interfaces
        {"interface": "udp_multicast", "channel": "239.0.0.1", "can_filters": [{"can_id": 0x590, "can_mask": 0x7FF}]},
        {"interface": "udp_multicast", "channel": "239.0.0.1", "fd": False},
    ]
    assert [socket_frames(driver, settings) for settings in kept] == [None] * 4
    with can.Bus(interface="virtual", channel="no-socket") as virtual:
        assert socket_frames(virtual, SETTINGS) is None


def test_closing_leaves_no_file_open(monkeypatch: pytest.MonkeyPatch) -> None:
    bus, wire = opened(SETTINGS, monkeypatch)
    bus.open()
    bus.close()
    assert wire.recv(100) == b""  # nobody has the other end any more
    wire.close()
