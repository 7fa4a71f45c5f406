"""All nodes together use less than 30 % of the bus, and none starves."""

from collections import Counter
from heapq import heappop, heappush

import pytest

from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus_budget import BURST, EXCHANGE_BITS, TICK_S, BusBudget, Share
from orchestrator.protocol.objects import Sweep
from tests.devices.bmu_bench import ONCE, WORDS, config


def reserve(budget: BusBudget, seconds: float) -> int:
    """Start as many exchanges as possible in this time."""
    count = 0
    while budget.reserve(0.0) < seconds:
        count += 1
    return count


def test_an_exchange_is_counted_with_its_worst_stuffing() -> None:
    assert EXCHANGE_BITS == 270


@pytest.mark.parametrize("bitrate", [50_000, 125_000, 250_000, 1_000_000])
def test_never_more_than_the_share_and_a_burst(bitrate: int) -> None:
    count = reserve(BusBudget(bitrate), 10.0)
    assert (count - BURST) * EXCHANGE_BITS <= 0.30 * bitrate * 10.0
    assert count * EXCHANGE_BITS > 0.29 * bitrate * 10.0


def test_an_idle_bus_saves_up_no_more_than_a_burst() -> None:
    budget = BusBudget(250_000)
    begins = [budget.reserve(100.0) for _ in range(BURST + 1)]
    assert begins[:BURST] == pytest.approx([100.0] * BURST)
    assert begins[BURST] > 100.003


#: The objects of a TABOS BMU: volts and amps, status; temperature; SOC and SOH, capacity and energy.
COUNTS = {Sweep.FAST: 2, Sweep.MEDIUM: 1, Sweep.SLOW: 2}
PLANNED_HZ = 0.9 * 75_000 / 270  #: of 250 kbit/s


def joined(nodes: int) -> tuple[BusBudget, list[Share]]:
    """So many nodes on 250 kbit/s, all of them watched closely."""
    budget = BusBudget(250_000)
    return budget, [budget.join(COUNTS, 0.05) for _ in range(nodes)]


def periods(budget: BusBudget, share: Share) -> list[float]:
    return [budget.period_s(share, sweep) for sweep in Sweep]


def test_one_node_is_not_stretched_many_are_all_alike() -> None:
    budget, shares = joined(1)
    assert periods(budget, shares[0]) == [0.05, 0.5, 1.0]
    budget, shares = joined(16)
    assert budget.period_s(shares[0], Sweep.FAST) == pytest.approx(16 * 40 * 0.05 / (PLANNED_HZ - 16 * (2 + 2)))
    twice = budget.join(COUNTS, 0.1)
    assert budget.period_s(twice, Sweep.FAST) == pytest.approx(2 * budget.period_s(shares[0], Sweep.FAST))
    assert periods(budget, shares[0])[1:] == [0.5, 1.0]


def test_on_a_full_bus_all_else_yields_to_the_sweeps() -> None:
    budget, shares = joined(64)
    assert periods(budget, shares[0]) == [pytest.approx(64 * 2 / (PLANNED_HZ - 64 * (1 + 1))), 1.0, 2.0]


def test_where_even_one_a_second_is_too_much_all_objects_share_alike() -> None:
    budget, shares = joined(128)
    assert periods(budget, shares[0]) == pytest.approx([128 * 5 / PLANNED_HZ] * 3)


def test_what_the_nodes_at_rest_leave_the_others_have() -> None:
    budget, shares = joined(32)
    full_s = budget.period_s(shares[0], Sweep.FAST)
    for share in shares[4:]:
        budget.watch(share, closely=False)
    assert periods(budget, shares[-1]) == [1.0, 1.0, 2.0]
    few_s = budget.period_s(shares[0], Sweep.FAST)
    assert few_s == pytest.approx(4 * 2 / (PLANNED_HZ - 32 * 2 - 28 * 2))
    assert few_s < full_s / 5
    for share in shares[4:]:
        budget.watch(share, closely=True)
    assert budget.period_s(shares[0], Sweep.FAST) == full_s


def test_nobody_at_rest_is_read_more_often_than_who_is_watched_closely() -> None:
    budget, shares = joined(64)
    full = periods(budget, shares[0])
    for share in shares[4:]:
        budget.watch(share, closely=False)
    assert periods(budget, shares[0]) == periods(budget, shares[-1]) == full


def test_on_a_bus_with_room_a_node_at_rest_is_read_twice_a_second() -> None:
    budget, shares = joined(8)
    budget.watch(shares[0], closely=False)
    assert periods(budget, shares[0]) == [0.5, 0.5, 1.0]


class Station:
    """Nodes on one bus that answer after `latency_s`, in simulated time."""

    def __init__(self, nodes: int, bitrate: int) -> None:
        budget = BusBudget(bitrate)
        self.nodes = [BatteryNode("can0", config(node_id=1 + i), budget, lambda: None) for i in range(nodes)]
        self.exchanges: Counter[int] = Counter()
        self.sent_s: list[float] = []
        self.now_s = 0.0

    def run(self, until_s: float, latency_s: float = 0.001) -> None:
        answers: list[tuple[float, int, bytes]] = []

        def send(cob_id: int, data: bytes) -> None:
            node = cob_id - 0x600
            self.exchanges[node] += 1
            self.sent_s.append(self.now_s)
            word = (ONCE | WORDS)[data[1] | data[2] << 8].to_bytes(4, "little")
            heappush(answers, (self.now_s + latency_s, node, b"\x43" + data[1:4] + word))

        while self.now_s < until_s:
            while answers and answers[0][0] <= self.now_s:
                _, node, data = heappop(answers)
                self.nodes[node - 1].on_frame(0x580 + node, data, self.now_s)
            for one in self.nodes:
                if one.next_due_s <= self.now_s:
                    one.turn(self.now_s, send)
            due_s = min(one.next_due_s for one in self.nodes)
            self.now_s = max(self.now_s + 1e-6, min([due_s, *(answer[0] for answer in answers[:1])]))


@pytest.mark.parametrize(("nodes", "bitrate"), [(1, 250_000), (16, 250_000), (64, 250_000), (16, 1_000_000)])
def test_a_station_stays_below_the_share_and_every_value_young(nodes: int, bitrate: int) -> None:
    station = Station(nodes, bitrate)
    station.run(3.0)
    station.exchanges.clear()
    station.run(8.0)
    assert station.exchanges.total() * EXCHANGE_BITS / 5.0 <= 0.30 * bitrate
    assert max(station.exchanges.values()) <= 1.1 * min(station.exchanges.values()) + 2
    for node in station.nodes:
        reading, link = node.view
        assert link.online
        assert reading.voltage_v is not None
        assert reading.soc_pct is not None
        assert station.now_s - reading.voltage_v.t_s < 1.3
        assert station.now_s - reading.soc_pct.t_s < 2.5


def test_all_at_once_at_the_start_are_spaced() -> None:
    station = Station(64, 250_000)
    station.run(1.0)
    assert len(station.sent_s) > 200
    assert all(sent_s >= (i - BURST) * 270 / 75_000 for i, sent_s in enumerate(station.sent_s))


def test_silent_nodes_cost_the_others_next_to_nothing() -> None:
    station = Station(8, 250_000)
    station.run(2.0)
    dead = station.nodes[4:]
    for node in dead:
        node.on_frame = lambda *_args: None  # type: ignore[method-assign]  # it hears nothing from now on
    station.run(6.0)
    station.exchanges.clear()
    station.run(10.0)
    assert all(not node.view[1].online for node in dead)
    assert all(station.exchanges[5 + i] <= 9 for i in range(4))
    assert all(station.exchanges[1 + i] >= 100 for i in range(4))


@pytest.mark.parametrize(
    ("nodes", "bitrate", "ticks"),
    [(1, 250_000, 1), (16, 250_000, 2), (64, 250_000, 4), (64, 500_000, 2), (64, 1_000_000, 1), (16, 1_000_000, 1)],
)
def test_a_tick_is_as_long_as_the_queue_and_the_sweeps_allow(nodes: int, bitrate: int, ticks: int) -> None:
    budget = BusBudget(bitrate)
    shares = [budget.join(COUNTS, 0.05) for _ in range(nodes)]
    assert budget.tick_s == ticks * TICK_S
    assert budget.tick_s * budget.capacity_hz < 6
    for share in shares:
        budget.watch(share, closely=False)
    assert budget.tick_s >= ticks * TICK_S  # nobody waits for anything at rest
    budget.watch(shares[0], closely=True)
    assert budget.tick_s <= budget.period_s(shares[0], Sweep.FAST) / 10
