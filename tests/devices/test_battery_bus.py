"""BMUs on real buses, read by the service's own thread: normal operation and every failure."""

import os
import random
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

import can
import pytest

from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus import REOPEN_S, STALL_S, BatteryBus
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.errors import LinkError
from orchestrator.link.can import CanBus
from orchestrator.model import BatteryLink, BatteryReading, Cause
from orchestrator.protocol.sdo import NmtCommand
from tests.core.said import cause, say
from tests.devices.bmu_bench import config
from tests.devices.fake_bmu import Bmus
from tests.link.ptys import Pty
from tests.waiting import wait_until

FAKE_BMU = Path(__file__).with_name("fake_bmu.py")


def no_one() -> None:
    """A callback that does nothing."""


class Station:
    """One bus with BMUs 0x10, 0x11, …, read by the product."""

    def __init__(
        self, settings: dict[str, object], nodes: int = 1, on_change: Callable[[], None] = no_one, **keys: float | None
    ) -> None:
        self.ids = [0x10 + i for i in range(nodes)]
        self.port = CanBus("can0", settings, self.ids)
        budget = BusBudget(self.port.bitrate)
        configs = [config(node_id=node_id, **keys) for node_id in self.ids]  # type: ignore[arg-type]  # its own keys
        self.nodes = [BatteryNode("can0", one, budget, on_change) for one in configs]
        self.bus = BatteryBus(self.port, self.nodes, budget, time.monotonic)

    def reading(self, number: int = 0) -> BatteryReading:
        return self.nodes[number].view[0]

    def link(self, number: int = 0) -> BatteryLink:
        return self.nodes[number].view[1]

    def await_link(self, condition: Callable[[BatteryLink], object], what: str, number: int = 0) -> BatteryLink:
        wait_until(lambda: condition(self.link(number)), what=what)
        return self.link(number)

    def await_fresh(self, number: int = 0) -> None:
        """Wait for a value requested after this call."""
        now_s = time.monotonic()
        wait_until(
            lambda: (volts := self.reading(number).voltage_v) is not None and volts.t_s >= now_s, what="a fresh value"
        )

    def __enter__(self) -> Self:
        self.bus.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.bus.close()


@pytest.fixture
def virtual() -> dict[str, object]:
    return {"interface": "virtual", "channel": f"test-{random.getrandbits(64):x}"}


@contextmanager
def bmus_on(settings: dict[str, object], *node_ids: int) -> Iterator[Bmus]:
    with can.Bus(**settings) as bus:  # type: ignore[arg-type]  # as in a station file
        bmus = Bmus(bus, list(node_ids))
        bmus.start()
        yield bmus
        bmus.close()


@pytest.fixture
def udp() -> dict[str, object]:
    group = f"239.{random.randrange(256)}.{random.randrange(256)}.{random.randrange(1, 255)}"
    return {"interface": "udp_multicast", "channel": group, "port": random.randrange(20_000, 60_000)}


@contextmanager
def process_on(udp: dict[str, object], *node_ids: int) -> Iterator[subprocess.Popen[bytes]]:
    arguments = [str(udp["channel"]), str(udp["port"]), *map(str, node_ids)]
    process = subprocess.Popen([sys.executable, str(FAKE_BMU), *arguments], stdout=subprocess.PIPE)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        yield process
    finally:
        process.kill()
        process.communicate()


# --- well ------------------------------------------------------------------------------------------------------------


def test_several_bmus_in_another_process_on_one_bus(udp: dict[str, object]) -> None:
    with process_on(udp, 0x10, 0x11, 0x12), Station(udp, nodes=3, heartbeat_s=0.1) as station:
        for number in range(3):
            station.await_fresh(number)
            station.await_link(lambda link: link.nmt_state == 0x7F, "a heartbeat", number)
            wait_until(lambda n=number: station.reading(n).temperature_c, what="the temperature")  # type: ignore[misc]
            assert station.link(number).online
            assert station.link(number).heartbeat_s == 0.1
            assert station.reading(number).voltage_v.value == 23.68  # type: ignore[union-attr]  # await_fresh
        assert not station.bus.stalled(time.monotonic())


def test_a_change_is_told_at_once(virtual: dict[str, object]) -> None:
    told = threading.Event()
    with bmus_on(virtual, 0x10) as bmus, Station(virtual, on_change=told.set) as station:
        station.await_fresh()
        bmus.nodes[0].words[0x6004] = 600
        wait_until(lambda: told.wait(1.0) and station.reading().temperature_c.value == 60.0)  # type: ignore[union-attr]


def test_a_bmu_that_is_switched_on_later_or_reset_is_noticed(virtual: dict[str, object]) -> None:
    with Station(virtual, heartbeat_s=0.1) as station:
        station.await_link(lambda link: "does not answer" in say(link.problem), "silence")
        with bmus_on(virtual, 0x10):
            station.await_link(lambda link: link.online and link.boots == 1 and link.nmt_state, "the first boot")
            with can.Bus(**virtual) as master:  # type: ignore[arg-type]  # as in a station file
                reset = bytes((NmtCommand.RESET_NODE, 0x10))
                master.send(can.Message(arbitration_id=0, data=reset, is_extended_id=False))
            link = station.await_link(lambda link: link.boots == 2 and link.nmt_state, "the second boot")
            assert link.heartbeat_s == 0.1  # configured again
            station.await_fresh()


def test_tpdos_on_a_real_bus(virtual: dict[str, object]) -> None:
    with bmus_on(virtual, 0x10) as bmus, Station(virtual, tpdo_s=0.05, heartbeat_s=0.1) as station:
        station.await_link(lambda link: link.nmt_state == 5, "NMT start")
        bmus.nodes[0].words[0x6000] = 0x09C40064
        wait_until(lambda: station.reading().voltage_v.value == 25.0, what="the TPDO's value")  # type: ignore[union-attr]
        begin = len(bmus.nodes[0].requests)
        wait_until(lambda: len(bmus.nodes[0].requests) >= begin + 10, what="the cross-check")
        assert station.link().implausible == {}


# --- others ---------------------------------------------------------------------------------------------------------


def test_two_services_on_one_bus_read_the_same_bmu_and_know_of_each_other(udp: dict[str, object]) -> None:
    with process_on(udp, 0x10), Station(udp, heartbeat_s=0.5) as station, Station(udp, heartbeat_s=0.5) as second:
        for one in (station, second):
            one.await_link(lambda link: link.other_master, "the other service")
        begun_s = time.monotonic()
        while time.monotonic() < begun_s + 1.5:
            for one in (station, second):
                one.await_fresh()
                assert (say(one.link().problem), one.link().implausible, say(one.link().abort)) == ("", {}, "")
                assert say(one.link().heartbeat_set) == ""


def test_our_own_requests_that_come_back_are_no_other_master(udp: dict[str, object]) -> None:
    with process_on(udp, 0x10), Station(udp, heartbeat_s=0.1, tpdo_s=0.1) as station:
        station.await_link(lambda link: link.nmt_state == 5, "NMT start")
        for _ in range(20):
            station.await_fresh()
        assert say(station.link().other_master) == ""


def test_thousands_of_foreign_frames_a_second_starve_nothing(udp: dict[str, object]) -> None:
    ending, sent = threading.Event(), 0

    def flood() -> None:
        nonlocal sent
        with can.Bus(**udp, hop_limit=0) as bus:  # type: ignore[arg-type]  # as in a station file
            begun_s = time.monotonic()
            while not ending.is_set():
                while sent < 2000 * (time.monotonic() - begun_s):
                    bus.send(can.Message(arbitration_id=0x123, data=bytes(8), is_extended_id=False))
                    sent += 1
                ending.wait(0.001)

    with process_on(udp, 0x10), Station(udp) as station:
        station.await_fresh()
        thread = threading.Thread(target=flood)
        thread.start()
        try:
            begun_s, before = time.monotonic(), sent
            while time.monotonic() < begun_s + 2.0:
                station.await_fresh()
                assert station.link().online
                assert not station.bus.stalled(time.monotonic())
            assert sent - before > 1000
        finally:
            ending.set()
            thread.join()


# --- broken ----------------------------------------------------------------------------------------------------------


def test_a_killed_bmu_is_silence_not_a_broken_bus(udp: dict[str, object]) -> None:
    with Station(udp) as station:
        with process_on(udp, 0x10) as process:
            station.await_fresh()
            process.kill()
            killed_s = time.monotonic()
            link = station.await_link(lambda link: not link.online, "silence")
            assert time.monotonic() - killed_s < 2.0
            assert "does not answer: check its power" in say(link.problem)
        with process_on(udp, 0x10):
            station.await_fresh()
            assert station.link().online


def test_a_socket_that_breaks_is_reported_and_the_bus_built_anew(udp: dict[str, object]) -> None:
    with process_on(udp, 0x10), Station(udp) as station:
        station.await_fresh()
        first = station.port._bus
        with Path(os.devnull).open("rb") as nothing:
            os.dup2(nothing.fileno(), station.port._frames._socket.fileno())  # type: ignore[union-attr]  # ours
        link = station.await_link(lambda link: not link.online, "the failure")
        broken_s = time.monotonic()
        assert say(link.problem).startswith("CAN bus can0 (udp_multicast 239.")
        station.await_fresh()
        assert time.monotonic() - broken_s > 0.9 * REOPEN_S
        assert station.link().online
        assert say(station.link().problem) == ""
        assert station.port._bus is not first


def test_a_bus_that_is_not_there_yet_is_waited_for(tmp_path: Path) -> None:
    adapter = Pty(tmp_path / "adapter")
    adapter.unplug()
    with Station({"interface": "slcan", "channel": adapter.path, "sleep_after_open": 0}) as station:
        link = station.await_link(lambda link: "plugged in" in say(link.problem), "the failure")
        assert not link.online
        adapter.plug()
        with slcan_bmu(adapter):
            station.await_fresh()
            adapter.unplug()
            link = station.await_link(lambda link: not link.online, "the unplugging")
            assert "plug it in again" in say(link.problem)
        adapter.plug()
        with slcan_bmu(adapter):
            station.await_fresh()
            assert station.link().online
    adapter.unplug()


@contextmanager
def slcan_bmu(adapter: Pty) -> Iterator[None]:
    """Answers every read of node 0x10 with the sample's value, in an adapter's text protocol."""
    master, ending = adapter.master, threading.Event()
    os.set_blocking(master, False)

    def serve() -> None:
        buffer = b""
        while not ending.wait(0.001):
            try:
                buffer += os.read(master, 4096)
                *lines, buffer = buffer.split(b"\r")
                for line in lines:
                    if line.startswith(b"t610840"):
                        os.write(master, b"t590843" + line[7:13] + b"F8FF4009\r")
            except BlockingIOError:
                continue
            except OSError:
                return

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield
    ending.set()
    thread.join()


def test_bus_off_is_shown_while_nothing_is_heard_again(virtual: dict[str, object]) -> None:
    with Station(virtual) as station:
        with bmus_on(virtual, 0x10) as bmus:
            station.await_fresh()
            bmus.nodes[0].mute = True
            bmus.bus.send(can.Message(arbitration_id=0x040, data=bytes(8), is_error_frame=True))
            station.await_link(lambda link: "bus-off" in say(link.problem), "bus-off")
        station.await_link(lambda link: "does not answer: the controller is bus-off" in say(link.problem), "the reason")
        with bmus_on(virtual, 0x10):
            station.await_fresh()


# --- our own mistakes ------------------------------------------------------------------------------------------------


def test_a_bug_in_one_nodes_code_is_that_nodes_problem(
    virtual: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    with bmus_on(virtual, 0x10, 0x11), Station(virtual, nodes=2) as station:
        station.await_fresh(0)
        station.await_fresh(1)
        with monkeypatch.context() as patch:
            patch.setattr(station.nodes[0], "turn", lambda *_args: 1 // 0)
            link = station.await_link(lambda link: not link.online, "the node's failure")
            assert "internal error: ZeroDivisionError" in say(link.problem)
            station.await_fresh(1)
            assert station.link(1).online
        station.await_fresh(0)
        assert station.link(0).online
        assert station.link(0).problem is None


def test_a_bug_on_receiving_is_that_nodes_problem(virtual: dict[str, object]) -> None:
    with bmus_on(virtual, 0x10, 0x11), Station(virtual, nodes=2) as station:
        station.await_fresh(0)
        station.nodes[0]._handlers[0x590] = lambda *_args: 1 // 0  # type: ignore[assignment]  # a bug
        link = station.await_link(lambda link: not link.online, "the node's failure")
        assert "internal error: ZeroDivisionError" in say(link.problem)
        station.await_fresh(1)


def test_a_listener_that_raises_does_not_end_the_thread(virtual: dict[str, object]) -> None:
    def broken() -> None:
        raise ValueError("the listener's bug")

    with bmus_on(virtual, 0x10), Station(virtual, on_change=broken) as station:
        station.await_link(lambda link: "the listener's bug" in say(link.problem), "its failure")
        station.await_fresh()
        assert not station.bus.stalled(time.monotonic())


def test_a_bug_in_the_link_takes_all_nodes_offline_and_the_bus_is_built_anew(
    virtual: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    with bmus_on(virtual, 0x10, 0x11), Station(virtual, nodes=2) as station:
        station.await_fresh(0)
        station.await_fresh(1)
        with monkeypatch.context() as patch:
            patch.setattr(station.port, "receive", lambda *_args: 1 // 0)
            for number in range(2):
                link = station.await_link(lambda link: not link.online, "the failure", number)
                assert "CAN bus can0: internal error: ZeroDivisionError" in say(link.problem)
        station.await_fresh(0)
        station.await_fresh(1)


class HangingPort:
    """A driver whose call never returns."""

    name = "can0"
    trouble: Cause | None = None

    def __init__(self) -> None:
        self.hanging, self.opened = threading.Event(), threading.Event()

    def subscribe(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None: ...

    def open(self) -> None:
        self.opened.set()

    def close(self) -> None: ...

    def receive(self, timeout_s: float, pause_s: float = 0.0) -> None:
        self.hanging.wait(10)
        raise LinkError(cause("at last"))

    def send(self, cob_id: int, data: bytes) -> None: ...

    def nmt(self, node_id: int, command: NmtCommand) -> None: ...


def test_a_loop_that_hangs_is_found_out() -> None:
    port, now_s = HangingPort(), 0.0
    bus = BatteryBus(port, [], BusBudget(250_000), lambda: now_s)
    bus.start()
    wait_until(lambda: bus._open, what="the bus")
    assert not bus.stalled(STALL_S)
    assert bus.stalled(STALL_S + 0.01)
    port.hanging.set()
    wait_until(lambda: not bus.stalled(9.0), what="the end of the hang")  # it broke; closing it does not hang
    bus.close()
