"""The bus on real python-can interfaces: virtual, udp_multicast, and slcan on a pty."""

import os
import random
import select
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest

from orchestrator.errors import LinkError, RefusedError
from orchestrator.link import can_text
from orchestrator.link.can import DEFAULT_BITRATE, MAX_GARBAGE, CanBus
from orchestrator.model import Cause
from orchestrator.protocol.sdo import NmtCommand
from tests.core.said import raises, say
from tests.link.ptys import Pty
from tests.waiting import wait_until

READ = bytes.fromhex("40 00 60 00 00 00 00 00")
OTHER_READ = bytes.fromhex("40 01 60 00 00 00 00 00")
ANSWER = bytes.fromhex("43 00 60 00 F8 FF 40 09")
Frames = list[tuple[int, bytes]]


def message(cob_id: int, data: bytes, **kind: bool) -> can.Message:
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=kind.pop("extended", False), **kind)


def opened(settings: dict[str, object]) -> tuple[CanBus, Frames]:
    """A bus that hands the answers of node 0x10 to a list."""
    bus, heard = CanBus("can0", settings, [0x10]), Frames()
    bus.subscribe(0x590, lambda cob_id, data: heard.append((cob_id, data)))
    bus.open()
    return bus, heard


def listen(bus: CanBus, condition: Callable[[], object], what: str) -> None:
    """Receive until the condition is true."""

    def step() -> object:
        bus.receive(0.02)
        return condition()

    wait_until(step, what=what)


@pytest.fixture
def channel() -> str:
    return f"test-{random.getrandbits(64):x}"


@pytest.fixture
def pair(channel: str) -> Iterator[tuple[CanBus, Frames, can.BusABC]]:
    """Our bus and its other end, on python-can's virtual interface."""
    bus, heard = opened({"interface": "virtual", "channel": channel})
    with can.Bus(interface="virtual", channel=channel) as other:
        yield bus, heard, other
    bus.close()


def unreadable(bus: CanBus) -> list[Exception]:
    """Make the driver's reads fail from now on."""
    came: list[Exception] = []
    good = bus._unreadable

    def noted(error: Exception) -> None:
        came.append(error)
        good(error)

    bus._unreadable = noted  # type: ignore[method-assign]  # nothing else shows that noise has come
    return came


Pair = tuple[CanBus, Frames, can.BusABC]


# --- frames ----------------------------------------------------------------------------------------------------------


def test_a_frame_each_way(pair: Pair) -> None:
    bus, heard, other = pair
    bus.send(0x610, READ)
    sent = other.recv(1.0)
    assert sent is not None
    assert (sent.arbitration_id, bytes(sent.data), sent.is_extended_id) == (0x610, READ, False)
    other.send(message(0x590, ANSWER))
    bus.receive(1.0)
    assert heard == [(0x590, ANSWER)]


def test_foreign_frames_do_not_disturb(pair: Pair) -> None:
    bus, heard, other = pair
    other.send(message(0x590, ANSWER, extended=True))
    other.send(message(0x590, b"", is_remote_frame=True))
    other.send(message(0x123, b"abc"))
    other.send(message(0x470, b"\x70"))  # the BMU's older protocol
    other.send(message(0x7E4, bytes(8)))  # LSS, which canopen would store for ever
    for _ in range(5):
        bus.receive(1.0)
    assert heard == []
    assert bus._network is not None
    assert bus._network.lss.responses.empty()
    other.send(message(0x590, ANSWER))
    bus.receive(1.0)
    assert heard == [(0x590, ANSWER)]


@pytest.mark.parametrize("length", [0, 1, 8, 12, 64])
def test_a_can_fd_frame_is_never_taken_for_canopen(channel: str, length: int) -> None:
    settings: dict[str, object] = {"interface": "virtual", "channel": channel, "protocol": can.CanProtocol.CAN_FD}
    bus, heard = opened(settings)
    bus.subscribe(0x710, lambda cob_id, data: heard.append((cob_id, data)))
    bus.close()
    bus.open()
    with can.Bus(**settings) as other:  # type: ignore[arg-type]  # as in a station file
        for cob_id in (0x590, 0x710):
            other.send(message(cob_id, bytes(length), is_fd=True))
            bus.receive(1.0)
        assert heard == []
        other.send(message(0x590, ANSWER))
        bus.receive(1.0)
        assert heard == [(0x590, ANSWER)]
    bus.close()


def test_frames_of_any_length_are_handed_on_whole(pair: Pair) -> None:
    bus, heard, other = pair
    for length in range(9):
        other.send(message(0x590, bytes(length)))
        bus.receive(1.0)
    assert [len(data) for _, data in heard] == list(range(9))


def test_what_a_callback_raises_is_not_swallowed(pair: Pair) -> None:
    bus, _, other = pair

    def broken(_cob_id: int, _data: bytes) -> None:
        raise ZeroDivisionError("a bug")

    bus.subscribe(0x591, broken)
    bus.close()
    bus.open()  # subscriptions hold for the next bus too
    other.send(message(0x591, ANSWER))
    with pytest.raises(ZeroDivisionError, match="a bug"):
        bus.receive(1.0)


@pytest.mark.parametrize(
    ("cob_id", "data"),
    [(0x610, bytes.fromhex("23 00 60 00 01 00 00 00")), (0x611, READ), (0x190, ANSWER), (0x000, b"\x81\x00")],
)
def test_what_the_gate_refuses_does_not_reach_the_wire(pair: Pair, cob_id: int, data: bytes) -> None:
    bus, _, other = pair
    with pytest.raises(RefusedError, match="not sent"):
        bus.send(cob_id, data)
    assert other.recv(0) is None


def test_what_canopen_sends_by_itself_goes_through_the_gate_too(pair: Pair) -> None:
    bus, _, other = pair
    network = bus._network
    assert network is not None
    with pytest.raises(RefusedError):
        network.scanner.search(0x20)
    with pytest.raises(RefusedError):
        network.nmt.send_command(0x81)  # to all nodes
    with pytest.raises(RefusedError):
        network.send_message(0x610, READ, remote=True)
    network.send_message(0x610, READ)
    sent = other.recv(1.0)
    assert sent is not None
    assert bytes(sent.data) == READ
    assert other.recv(0) is None


def test_each_nmt_command_goes_to_one_node(pair: Pair) -> None:
    bus, _, other = pair
    for command in NmtCommand:
        bus.nmt(0x10, command)
        sent = other.recv(1.0)
        assert sent is not None
        assert (sent.arbitration_id, bytes(sent.data)) == (0, bytes((command, 0x10)))
    assert other.recv(0) is None


def test_nmt_to_a_foreign_node_is_refused_at_once(pair: Pair) -> None:
    with pytest.raises(RefusedError, match="0x11"):
        pair[0].nmt(0x11, NmtCommand.STOP)


# --- error frames ----------------------------------------------------------------------------------------------------


def test_bus_off_breaks_the_bus_and_is_remembered_until_a_frame_comes(pair: Pair) -> None:
    bus, _, other = pair
    other.send(message(0x040, bytes(8), is_error_frame=True))
    with raises(LinkError, match="bus-off"):
        bus.receive(1.0)
    bus.close()
    bus.open()
    assert "restart-ms 100" in say(bus.trouble)
    other.send(message(0x123, b""))
    bus.receive(1.0)
    assert say(bus.trouble) == ""


def test_an_error_passive_controller_is_noticed(pair: Pair) -> None:
    bus, heard, other = pair
    other.send(message(0x004, bytes.fromhex("00 20 00 00 00 00 80 00"), is_error_frame=True))
    bus.receive(1.0)
    assert bus.trouble == Cause(can_text.PASSIVE)
    other.send(message(0x008, bytes(8), is_error_frame=True))  # passing noise is not reported
    bus.receive(1.0)
    assert bus.trouble == Cause(can_text.PASSIVE)
    other.send(message(0x004, bytes.fromhex("00 40 00 00 00 00 00 00"), is_error_frame=True))
    bus.receive(1.0)
    assert say(bus.trouble) == ""
    assert heard == []


# --- what can break --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"interface": "socketcan", "channel": "can77", "bitrate": 250_000}, "socketcan can77"),
        ({"interface": "slcan", "channel": "/dev/serial/by-path/none"}, "is the adapter plugged in"),
        ({"interface": "no-such"}, "no-such"),
        ({"channel": "can0"}, "interface"),
        ({"interface": "udp_multicast", "channel": "not an address"}, "udp_multicast not an address"),
    ],
)
def test_a_bus_that_cannot_be_opened_says_why(settings: dict[str, object], words: str) -> None:
    bus = CanBus("left", settings, [0x10])
    with raises(LinkError, match=r"^CAN bus left ") as failure:
        bus.open()
    assert words in say(failure.value.cause)
    bus.close()


def test_a_bit_timing_is_made_of_what_the_station_file_says(channel: str) -> None:
    timing = {"f_clock": 8_000_000, "brp": 1, "tseg1": 13, "tseg2": 2, "sjw": 1}
    bus, _ = opened({"interface": "virtual", "channel": channel, "timing": timing})
    bus.close()
    with raises(LinkError, match="tseg1"):
        opened({"interface": "virtual", "channel": channel, "timing": {"f_clock": 8_000_000, "brp": 1}})


def test_a_closed_bus_neither_sends_nor_receives(channel: str) -> None:
    bus = CanBus("can0", {"interface": "virtual", "channel": channel}, [0x10])
    with raises(LinkError, match="is not open"):
        bus.receive(0.0)
    with raises(LinkError, match="is not open"):
        bus.send(0x610, READ)


@pytest.mark.parametrize(
    "full", [can.CanOperationError("Failed to transmit: x", 105), can.CanOperationError("Transmit buffer full")]
)
def test_a_full_transmit_queue_is_an_absent_bmu_not_a_broken_bus(
    pair: Pair, monkeypatch: pytest.MonkeyPatch, full: Exception
) -> None:
    bus, _, other = pair

    def send(*_args: object) -> None:
        raise full

    monkeypatch.setattr(bus._bus, "send", send)  # impossible on a bus without a wire
    bus.send(0x610, READ)
    assert "nobody acknowledges" in say(bus.trouble)
    other.send(message(0x590, ANSWER))
    bus.receive(1.0)
    assert say(bus.trouble) == ""


def test_a_send_that_fails_breaks_the_bus(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    bus = pair[0]

    def send(*_args: object) -> None:
        raise can.CanOperationError("Failed to transmit", 100)

    monkeypatch.setattr(bus._bus, "send", send)
    with raises(LinkError, match="Network is down"):
        bus.send(0x610, READ)


def test_a_driver_that_cannot_even_forget_its_noise_breaks_the_bus(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    bus = pair[0]

    def recv(*_args: object) -> None:
        raise ValueError("cannot decode")

    def flush() -> None:
        raise can.CanOperationError("Could not flush", 5)

    monkeypatch.setattr(bus._bus, "recv", recv)
    monkeypatch.setattr(bus._bus, "flush", flush, raising=False)  # an adapter unplugged at that moment
    with raises(LinkError, match="Input/output error"):
        bus.receive(0.0)


def test_nothing_but_the_station_file_says_how_a_bus_is_opened(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_CONFIG", '{"receive_own_messages": true}')
    bus, heard = opened({"interface": "virtual", "channel": channel})
    bus.subscribe(0x610, lambda cob_id, data: heard.append((cob_id, data)))
    bus.close()
    bus.open()
    bus.send(0x610, READ)
    bus.receive(0.05)
    assert heard == []
    bus.close()


def test_the_bit_rate_of_a_bus_without_one() -> None:
    assert CanBus("a", {"interface": "virtual"}, []).bitrate == DEFAULT_BITRATE
    assert CanBus("a", {"interface": "virtual", "bitrate": 250_000}, []).bitrate == 250_000


def test_the_libraries_are_not_imported_before_a_bus_is_opened() -> None:
    code = (
        "import sys, orchestrator.link.can, orchestrator.devices.bus; "
        "sys.exit(bool({'can', 'canopen'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --- udp_multicast ---------------------------------------------------------------------------------------------------


@pytest.fixture
def udp() -> dict[str, object]:
    group = f"239.{random.randrange(256)}.{random.randrange(256)}.{random.randrange(1, 255)}"
    return {"interface": "udp_multicast", "channel": group, "port": random.randrange(20_000, 60_000)}


def test_our_own_echo_is_tolerated_and_nothing_leaves_the_host(udp: dict[str, object]) -> None:
    bus, heard = opened(udp)
    raw = bus._bus._multicast  # type: ignore[union-attr]  # the driver's own
    assert raw._socket.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL) == 0
    with can.Bus(**udp, hop_limit=0) as other:  # type: ignore[arg-type]  # as in a station file
        bus.send(0x610, READ)
        bus.send(0x610, READ)
        other.send(message(0x590, ANSWER))
        listen(bus, lambda: heard, "the answer")
    assert heard == [(0x590, ANSWER)]
    bus.close()


ECHOES = [{"interface": "udp_multicast"}, {"interface": "virtual", "receive_own_messages": True}]


@pytest.mark.parametrize("kind", ECHOES, ids=["udp_multicast", "asked for"])
def test_what_we_sent_is_not_heard_but_the_same_frame_of_somebody_else_is(
    udp: dict[str, object], channel: str, kind: dict[str, object]
) -> None:
    settings = udp | kind if kind["interface"] == "udp_multicast" else {**kind, "channel": channel}
    bus, heard = opened(settings)
    bus.subscribe(0x610, lambda cob_id, data: heard.append((cob_id, data)))
    bus.close()
    bus.open()
    with can.Bus(**settings) as other:  # type: ignore[arg-type]  # as in a station file
        bus.send(0x610, OTHER_READ)
        bus.send(0x610, READ)
        other.send(message(0x610, READ))
        bus.send(0x610, READ)
        other.send(message(0x610, OTHER_READ))
        listen(bus, lambda: len(heard) >= 2, "the other's requests")
        other.send(message(0x590, ANSWER))
        listen(bus, lambda: len(heard) >= 3, "the answer behind them")
    assert heard == [(0x610, READ), (0x610, OTHER_READ), (0x590, ANSWER)]
    bus.close()


def test_an_echo_that_was_lost_does_not_hide_another_masters_frame(udp: dict[str, object]) -> None:
    bus, heard = opened(udp)
    bus.subscribe(0x610, lambda cob_id, data: heard.append((cob_id, data)))
    bus.close()
    bus.open()
    bus._echo.sent(0x610, OTHER_READ)  # the bus lost it
    bus.send(0x610, READ)
    listen(bus, lambda: not bus._echo._sent, "our own echo")
    with can.Bus(**udp, hop_limit=0) as other:  # type: ignore[arg-type]  # as in a station file
        other.send(message(0x610, OTHER_READ))
        listen(bus, lambda: heard, "the other's request")
    assert heard == [(0x610, OTHER_READ)]
    bus.close()


def test_a_datagram_that_is_no_frame_is_noise(udp: dict[str, object]) -> None:
    bus, heard = opened(udp)
    noise = unreadable(bus)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        for garbage in (b"", b"hello", b"\x93\x01\x02\x03", b"\x81\xa3foo\x01", bytes(range(256)) * 4):
            stranger.sendto(garbage, (str(udp["channel"]), int(str(udp["port"]))))
        listen(bus, lambda: len(noise) == 5, "five datagrams")
    with can.Bus(**udp, hop_limit=0) as other:  # type: ignore[arg-type]  # as in a station file
        other.send(message(0x590, ANSWER))
        listen(bus, lambda: heard, "the answer")
    bus.close()


def test_a_socket_closed_underneath_breaks_the_bus_and_a_new_one_works(udp: dict[str, object]) -> None:
    bus, heard = opened(udp)
    with Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), bus._frames._socket.fileno())  # type: ignore[union-attr]  # our own descriptor
    with raises(LinkError, match="udp_multicast"):
        for _ in range(MAX_GARBAGE):
            bus.receive(0.0)
    bus.close()
    bus.open()
    with can.Bus(**udp, hop_limit=0) as other:  # type: ignore[arg-type]  # as in a station file
        other.send(message(0x590, ANSWER))
        listen(bus, lambda: heard, "the answer")
    bus.close()


# --- slcan -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def adapter(tmp_path: Path) -> Iterator[Pty]:
    pty = Pty(tmp_path / "adapter")
    yield pty
    pty.unplug()


def slcan(adapter: Pty) -> tuple[CanBus, Frames]:
    return opened({"interface": "slcan", "channel": adapter.path, "bitrate": 250_000, "sleep_after_open": 0})


def read_line(adapter: Pty, wanted: bytes) -> None:
    """Read the adapter's input until it contains `wanted`."""
    seen = b""

    def arrived() -> bool:
        nonlocal seen
        if select.select([adapter.master], [], [], 0)[0]:
            seen += os.read(adapter.master, 4096)
        return wanted in seen

    wait_until(arrived, what=f"{wanted!r}")


def test_slcan_both_ways(adapter: Pty) -> None:
    bus, heard = slcan(adapter)
    read_line(adapter, b"S5\r")  # 250 kbit/s
    bus.send(0x610, READ)
    read_line(adapter, b"t61084000600000000000\r")
    os.write(adapter.master, b"t5908430060")
    bus.receive(0.0)
    os.write(adapter.master, b"00F8FF4009\r")
    listen(bus, lambda: heard, "the answer")
    assert heard == [(0x590, ANSWER)]
    bus.close()


@pytest.mark.parametrize("noise", [b"\xff\xfe\r", b"tzzz8\r", b"t5\r", b"T\r", b"\x00\x80\xff" * 30 + b"\r"])
def test_noise_on_slcan_costs_one_frame_not_the_bus(adapter: Pty, noise: bytes) -> None:
    bus, heard = slcan(adapter)
    came = unreadable(bus)
    os.write(adapter.master, noise)
    listen(bus, lambda: came, "the noise")
    os.write(adapter.master, b"t59084300600" + b"0F8FF4009\r")
    listen(bus, lambda: heard, "the answer")
    assert heard == [(0x590, ANSWER)]
    bus.close()


def test_an_adapter_that_is_unplugged_and_returns(adapter: Pty) -> None:
    bus, heard = slcan(adapter)
    adapter.unplug()
    with raises(LinkError, match=r"slcan .*plug it in again"):
        for _ in range(MAX_GARBAGE):
            bus.receive(0.0)
    bus.close()
    with raises(LinkError, match="is the adapter plugged in"):
        bus.open()
    adapter.plug()
    bus.open()
    os.write(adapter.master, b"t59084300600" + b"0F8FF4009\r")
    listen(bus, lambda: heard, "the answer")
    bus.close()


def test_an_unplugged_adapter_leaves_no_file_open(adapter: Pty) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    bus, _ = slcan(adapter)
    adapter.unplug()
    with pytest.raises(LinkError):
        for _ in range(MAX_GARBAGE):
            bus.receive(0.0)
    bus.close()  # while an old file is open, the kernel gives a returning adapter another name
    assert len(list(Path("/proc/self/fd").iterdir())) == before - 2  # the pty's own two


def test_a_stalled_adapter_does_not_stall_the_thread(adapter: Pty) -> None:
    bus, _ = slcan(adapter)
    with raises(LinkError, match="slcan"):
        for _ in range(2000):  # without a reader the pty takes about 4 kB
            bus.send(0x610, READ)
    bus.close()
