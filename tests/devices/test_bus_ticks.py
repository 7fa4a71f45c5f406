"""The bus is looked after in ticks: what shares a wake-up, what waits, and how much goes out at once."""

from collections.abc import Callable

import pytest

from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus import IDLE_S, MOST_AT_ONCE, BatteryBus
from orchestrator.devices.bus_budget import TICK_S, BusBudget
from orchestrator.devices.requester import Send
from orchestrator.model import Cause
from tests.devices.bmu_bench import ONCE, WORDS, config

#: linux/can/dev.h: what an interface takes before its driver says ENOBUFS.
TRANSMIT_QUEUE = 10


class Port:
    """Nodes that answer after `latency_s`, and a clock that jumps: a wait ends when it says, or with the next frame."""

    name = "can0"
    trouble: Cause | None = None

    def __init__(self, latency_s: float = 0.001) -> None:
        self.now_s = 100.0
        self.waits: list[tuple[float, float]] = []  #: now, and when each wait would end without a frame
        self.bursts: list[int] = []  #: frames sent between two waits
        self.requests: dict[int, int] = {}  #: by node
        self._latency_s = latency_s
        self._answers: list[tuple[float, int, bytes]] = []
        self._sent = 0
        self._callbacks: dict[int, Callable[[int, bytes], None]] = {}

    def subscribe(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None:
        self._callbacks[cob_id] = callback

    def open(self) -> None: ...

    def close(self) -> None: ...

    def send(self, cob_id: int, data: bytes) -> None:
        self._sent += 1
        self.requests[cob_id - 0x600] = self.requests.get(cob_id - 0x600, 0) + 1
        word = (ONCE | WORDS)[data[1] | data[2] << 8].to_bytes(4, "little")
        self._answers.append((self.now_s + self._latency_s, cob_id - 0x80, b"\x43" + data[1:4] + word))

    def receive(self, timeout_s: float, pause_s: float = 0.0) -> None:
        self.waits.append((self.now_s, self.now_s + timeout_s))
        self.bursts.append(self._sent)
        self._sent = 0
        end_s = self.now_s + timeout_s
        paused_s = self.now_s + pause_s
        if self._answers:
            end_s = min(end_s, max(paused_s, self._answers[0][0]))
        self.now_s = max(self.now_s, end_s)
        while self._answers and self._answers[0][0] <= self.now_s:
            _, cob_id, data = self._answers.pop(0)
            self._callbacks[cob_id](cob_id, data)


def bus_of(nodes: int, port: Port, bitrate: int = 1_000_000) -> BatteryBus:
    budget = BusBudget(bitrate)
    made = [BatteryNode("can0", config(node_id=1 + i), budget, lambda: None) for i in range(nodes)]
    return BatteryBus(port, made, budget, lambda: port.now_s)


def run(bus: BatteryBus, port: Port, seconds: float) -> None:
    end_s = port.now_s + seconds
    while port.now_s < end_s:
        bus._turn()


def on_a_tick(time_s: float) -> bool:
    return abs(time_s / TICK_S - round(time_s / TICK_S)) < 1e-6


def test_many_nodes_cost_a_wake_up_a_tick() -> None:
    port = Port()
    bus = bus_of(64, port)
    run(bus, port, 2.0)
    port.requests.clear()
    port.waits.clear()
    run(bus, port, 2.0)
    assert sum(port.requests.values()) > 1800
    assert len(port.waits) <= 2.0 / TICK_S + 1


def test_every_wait_ends_on_a_tick_and_none_is_longer_than_what_is_due() -> None:
    port = Port()
    bus = bus_of(3, port)
    run(bus, port, 3.0)
    assert all(on_a_tick(end_s) and begin_s < end_s <= begin_s + IDLE_S + TICK_S for begin_s, end_s in port.waits)


def test_a_node_alone_is_asked_as_often_as_it_should() -> None:
    port = Port()
    bus = bus_of(1, port)
    run(bus, port, 10.0)
    assert port.requests[1] >= 0.9 * 10 * (2 / 0.055 + 2 + 2)


def test_what_is_due_at_once_waits_for_the_next_tick() -> None:
    class Restless(BatteryNode):
        """Its bay changes its mind in the middle of each turn."""

        def turn(self, now_s: float, send: Send) -> None:
            super().turn(now_s, send)
            self.attend(closely=True)

    port = Port()
    budget = BusBudget(1_000_000)
    bus = BatteryBus(port, [Restless("can0", config(node_id=1), budget, lambda: None)], budget, lambda: port.now_s)
    bus._turn()
    ((begin_s, end_s),) = port.waits
    assert 0 < end_s - begin_s <= TICK_S + 1e-9


@pytest.mark.parametrize("bitrate", [250_000, 1_000_000])
def test_never_more_at_once_than_the_transmit_queue_takes_however_late(bitrate: int) -> None:
    port = Port()
    bus = bus_of(64, port, bitrate)
    for _ in range(200):
        run(bus, port, 0.05)
        port.now_s += 0.1  # the thread was not let run
    assert MOST_AT_ONCE < TRANSMIT_QUEUE
    assert max(port.bursts) == MOST_AT_ONCE
    least, most = min(port.requests.values()), max(port.requests.values())
    assert len(port.requests) == 64 and most <= 1.1 * least + 2  # nobody is passed over


def test_a_frame_ends_a_wait_in_which_nothing_is_going_on() -> None:
    port = Port(latency_s=0.02)
    bus = bus_of(1, port)
    bus._turn()
    assert port.now_s == pytest.approx(100.02)
