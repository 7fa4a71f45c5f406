"""Which news of the devices needs a decision at once, and which can wait for the tick."""

from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import pytest

from orchestrator.model import (
    STOP,
    BatteryLink,
    BatteryReading,
    Cause,
    ChargeMode,
    Measurement,
    Operation,
    Request,
    State,
)
from orchestrator.service.asked import Asked
from orchestrator.service.news import CALM_TICK_S, TICK_S
from tests.service.bench import STEP_S, VOLTS, Bench


@pytest.fixture(name="bench")
def _bench(tmp_path: Path) -> Bench:
    bench = Bench(tmp_path)
    bench.charging()
    assert not bench.bay.has_news()
    return bench


def charger_says(bench: Bench, **changes: Any) -> bool:
    bench.charger.reading = replace(bench.charger.reading, **changes)
    return bench.bay.has_news()


def battery_says(bench: Bench, **values: float) -> bool:
    bench.battery.values |= values
    return bench.bay.has_news()


@pytest.mark.parametrize(
    ("changes", "matters"),
    [
        ({"t_s": 1e6}, False),
        ({"voltage_v": VOLTS + 0.09}, False),
        ({"voltage_v": VOLTS + 0.11}, True),
        ({"voltage_v": nan}, True),
        ({"current_a": 13.6}, False),
        ({"current_a": 13.4}, True),
        ({"operation": Operation.STOPPED}, True),
        ({"charge_mode": ChargeMode.ERROR_STOP}, True),
        ({"current_step": 3}, True),
        ({"illegal": (Cause("illegal"),)}, True),
    ],
)
def test_what_a_charger_reports(bench: Bench, changes: dict[str, Any], *, matters: bool) -> None:
    assert charger_says(bench, **changes) is matters


@pytest.mark.parametrize(
    ("values", "matters"),
    [
        ({"voltage_v": VOLTS - 0.09}, False),
        ({"voltage_v": VOLTS - 0.11}, True),
        ({"current_a": 13.6}, False),
        ({"current_a": 14.6}, True),
        ({"temperature_c": 20.4}, False),
        ({"temperature_c": 20.6}, True),
        ({"status": 4.0}, True),
        ({"soc_pct": 55.0, "soh_pct": 80.0}, False),
    ],
)
def test_what_a_bmu_reports(bench: Bench, values: dict[str, float], *, matters: bool) -> None:
    assert battery_says(bench, **values) is matters


@pytest.mark.parametrize(
    ("quantity", "before", "at"),
    [
        ("voltage_v", 55.15, 55.2),
        ("temperature_c", 44.9, 45.0),
        ("temperature_c", 0.1, 0.0),
        ("temperature_c", 54.9, 55),
    ],
)
def test_a_bound_that_is_reached_matters_however_near_it_was(
    bench: Bench, quantity: str, before: float, at: float
) -> None:
    bay, (values, link) = bench.bay, bench.battery.view

    def showing(value: float) -> BatteryReading:
        return replace(values, **{quantity: Measurement(value, bench.now_s)})

    def matters(value: float) -> bool:
        known = replace(bay._snapshot, battery=showing(before))
        assert bay.decision is not None
        return bay.policy.news.matters(bay.decision, known, bench.charger.view, (showing(value), link))

    assert not matters(before + (at - before) / 2)
    assert matters(at)


def test_a_current_just_above_its_step_matters(bench: Bench) -> None:
    highest_a = bench.bay.policy.rules.measured_most_a(14.0)
    bench.charger.reading = replace(bench.charger.reading, current_a=highest_a - 0.1)
    bench.bay.run(bench.now_s + 0.1)
    assert not charger_says(bench, current_a=highest_a - 0.01)
    assert charger_says(bench, current_a=highest_a + 0.01)


def test_a_device_that_falls_silent_or_is_in_trouble_matters(bench: Bench) -> None:
    link = bench.charger.link
    bench.charger.link = replace(link, misses=1)
    assert bench.bay.has_news()
    bench.charger.link = replace(link, bad_pct=3.0, bad_frames=7)
    assert not bench.bay.has_news()


@pytest.mark.parametrize(
    ("view", "matters"),
    [
        ((BatteryReading(), BatteryLink(online=True)), True),
        ((None, BatteryLink(online=False)), True),
        ((None, BatteryLink(online=True, emergency=Cause("x"))), True),
        ((None, BatteryLink(online=True, heartbeat_t_s=5.0)), False),
    ],
)
def test_a_bmus_link(bench: Bench, view: tuple[Any, BatteryLink], *, matters: bool) -> None:
    bay, (values, _) = bench.bay, bench.battery.view
    assert bay.decision is not None
    seen = (values if view[0] is None else view[0], view[1])
    assert bay.policy.news.matters(bay.decision, bay._snapshot, bench.charger.view, seen) is matters


def test_a_value_that_goes_missing_matters(bench: Bench) -> None:
    values = bench.battery.view[0]
    for name in ("voltage_v", "current_a", "status", "temperature_c"):
        seen = replace(values, **{name: None})
        assert bench.bay.decision is not None
        assert bench.bay.policy.news.matters(
            bench.bay.decision, bench.bay._snapshot, bench.charger.view, (seen, BatteryLink(online=True))
        )


def test_while_something_is_under_way_all_news_matters(bench: Bench) -> None:
    bay = bench.bay
    assert bay.decision is not None
    for decision in (replace(bay.decision, command=STOP), replace(bay.decision, state=State.QUALIFYING)):
        bay.decision = decision
        assert bay.has_news()


def test_a_request_needs_a_decision(bench: Bench) -> None:
    bench.bay.ask(Asked(Request.STOP))
    assert bench.bay.has_news()


def test_at_rest_most_news_waits_too(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.battery.values["soc_pct"] = 100.0
    bench.step(10)
    assert (bench.bay.decision and bench.bay.decision.state) is State.IDLE
    assert not battery_says(bench, voltage_v=VOLTS + 0.05)
    assert battery_says(bench, current_a=1.0)


def test_the_tick_is_longer_at_rest(tmp_path: Path) -> None:
    resting = Bench(tmp_path)
    resting.battery.values["soc_pct"] = 100.0
    resting.step()
    assert resting.bay.due_s == resting.now_s + TICK_S  # its stop is not verified yet
    resting.step(10)
    assert resting.bay.due_s == resting.now_s + CALM_TICK_S
    resting.now_s += CALM_TICK_S - STEP_S
    resting.step()
    assert not resting.bay._snapshot.late_s


def test_the_tick_is_longer_in_a_charge_in_which_no_fault_is_seen(bench: Bench) -> None:
    assert bench.bay.due_s == bench.now_s + CALM_TICK_S
    bench.battery.values["voltage_v"] = VOLTS + 3.0  # not the charger's: seen, and no fault before it has lasted
    bench.step()
    assert bench.bay.decision is not None
    assert bench.bay.decision.state is State.CHARGING
    assert not bench.bay.decision.faults
    assert bench.bay.due_s == bench.now_s + TICK_S


@pytest.mark.parametrize("silent", ["charger", "battery"])
def test_no_value_gets_too_old_between_two_ticks(bench: Bench, silent: str) -> None:
    bench.step()
    since_s = bench.charger.reading.t_s if silent == "charger" else bench.battery.now_s
    while bench.now_s < since_s + 1.5:
        assert bench.bay.decision is not None
        assert bench.bay.decision.state is State.CHARGING
        bench.now_s = bench.bay.due_s
        if silent == "charger":
            bench.battery.now_s = bench.now_s
        else:
            bench.charger.pass_time(bench.now_s)
        if bench.bay.is_due(bench.now_s):
            bench.bay.run(bench.now_s)
    assert bench.now_s == since_s + 1.5


def test_a_value_that_has_come_meanwhile_does_not_get_too_old(bench: Bench) -> None:
    decided_s = bench.battery.now_s = bench.now_s = bench.bay.due_s
    bench.charger.reading = replace(bench.charger.reading, t_s=decided_s - 1.1)
    bench.bay.run(bench.now_s)
    bench.now_s = bench.bay.due_s
    assert bench.now_s < decided_s + CALM_TICK_S
    assert bench.bay.is_due(bench.now_s)
    bench.charger.reading = replace(bench.charger.reading, t_s=bench.now_s)
    assert not bench.bay.is_due(bench.now_s)
    assert bench.bay.due_s == decided_s + CALM_TICK_S
