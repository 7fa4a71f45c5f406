"""Our own estimate of how long a charge takes, held against simulated charges, and where there is none."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.config.load import load_policy
from orchestrator.core.decide import decide
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Memory, with_values
from orchestrator.core.rules import Rules
from orchestrator.model import Decision, Request, Snapshot, State
from orchestrator.service.forecast import bmu_minutes, capacity_ah, own_minutes
from orchestrator.workbench.simulate import simulation
from tests.core.world import World, bay
from tests.workbench.test_ordinary_charges import Ordinary

EVERY_S = 120.0
#: The estimate may be wrong by this, and a charge that tapers takes so much longer than any estimate.
WRONG_PCT, WRONG_MIN, TAPER_MIN = 10.0, 12.0, 35.0


def facts(world: World) -> Facts:
    assert world.memory.last_s is not None
    return Facts.of(world.memory.last_s, world.snapshot(None, ""), world.memory, world.rules)


def told(policy: str, monkeypatch: pytest.MonkeyPatch, **ordinary: Any) -> list[tuple[float, float, float]]:
    """(SOC, the minutes that were told, the minutes that it took) of one simulated charge."""
    found: list[tuple[float, float, float]] = []
    end_s = [0.0]

    def listening(now_s: float, snapshot: Snapshot, memory: Memory, rules: Rules) -> tuple[Decision, Memory]:
        decision, after = decide(now_s, snapshot, memory, rules)
        if decision.state is State.CHARGING:
            end_s[0] = now_s
            minutes = own_minutes(f := Facts.of(now_s, snapshot, after, rules))
            if minutes is not None and f.soc is not None and (not found or now_s - found[-1][2] >= EVERY_S):
                found.append((f.soc, minutes, now_s))
        return decision, after

    monkeypatch.setattr(simulation, "decide", listening)
    simulation.simulate(load_policy(policy), Ordinary(policy, **ordinary).scenario)
    return [(soc, minutes, (end_s[0] - at_s) / 60) for soc, minutes, at_s in found]


@pytest.mark.parametrize(
    ("policy", "hall_c", "soh_pct", "taper_min"),
    [
        ("li-ion-48v", 25.0, 85.0, TAPER_MIN),
        ("li-ion-48v", 8.0, 100.0, 15.0),
        ("long-life-48v", 25.0, 100.0, 0.0),
        ("lfp-48v", 25.0, 85.0, TAPER_MIN),
    ],
)
def test_the_estimate_is_near_the_truth_from_the_first_minute_on(
    policy: str, hall_c: float, soh_pct: float, taper_min: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = told(policy, monkeypatch, hall_c=hall_c, soc_pct=20.0, soh_pct=soh_pct)
    assert len(found) > 20 and found[0][0] < 22
    for soc_pct, minutes, truth in found:
        off = max(WRONG_MIN, truth * WRONG_PCT / 100)
        assert truth - off - taper_min <= minutes <= truth + off, (soc_pct, minutes, truth)


def settled(**values: float) -> World:
    world = World(None, **values).charging()
    world.run(60)
    return world


def test_each_row_counts_with_what_its_step_delivers() -> None:
    world = settled(soc_pct=50.0)
    world.rules = Rules.of(bay(load_policy("li-ion-48v", changes={"pack.capacity_ah": "20"})))
    # 40 % of 20 Ah at 14 A, and 10 % at 8 A
    assert own_minutes(facts(world)) == pytest.approx(60 * (8 / 14 + 2 / 8))
    world.amps = 7.0  # the charger delivers half of its step
    world.tick()
    assert own_minutes(facts(world)) == pytest.approx(60 * (8 / 7 + 2 / 4))


def test_what_the_charge_has_shown_counts_more_than_what_the_policy_says() -> None:
    world = settled(soc_pct=50.0)
    world.rules = Rules.of(bay(load_policy("li-ion-48v", changes={"pack.capacity_ah": "20"})))
    session = world.memory.session
    assert session is not None and capacity_ah(facts(world)) == 20
    world.values["soh_pct"] = 90.0
    world.run(1)
    assert capacity_ah(facts(world)) == pytest.approx(18)
    for soc_pct, ah, shown in ((59.0, 1.5, 18.0), (60.0, 1.5, 15.0), (60.0, 4.0, None), (60.0, 0.5, None)):
        world.memory = with_values(world.memory, session=replace(session, charged_ah=ah, soc_start_pct=50.0))
        world.values["soc_pct"] = soc_pct
        world.run(1)
        assert world.memory.session is not None
        found = capacity_ah(facts(world))
        assert found == (pytest.approx(shown, rel=0.02) if shown else None), (soc_pct, ah)


@pytest.mark.parametrize(
    "change",
    [
        {"soc_pct": None},
        {"soc_pct": 100.0},
        {"amps": 0.1},
    ],
)
def test_nothing_is_said_where_nothing_sensible_can_be(change: dict[str, float | None]) -> None:
    world = settled(soc_pct=50.0)
    world.rules = Rules.of(bay(load_policy("li-ion-48v")))
    assert own_minutes(facts(world)) is not None
    if "amps" in change:
        world.amps = change["amps"]
        world.tick()
    else:
        world.measured.pop("soc_pct")
        world.values.update(change)
    f = facts(world)
    assert own_minutes(f if "soc_pct" not in change else replace(f, soc=change["soc_pct"])) is None


def test_neither_before_the_current_has_come_nor_without_a_capacity_nor_at_rest() -> None:
    world = World(soc_pct=50.0).charging()
    world.rules = Rules.of(bay(load_policy("li-ion-48v")))
    assert own_minutes(facts(world)) is None, "it has just begun"
    assert own_minutes(facts(settled(soc_pct=50.0))) is None, "the tests' policy knows no capacity"
    world.run(60)
    assert own_minutes(facts(world)) is not None
    world.ask(Request.STOP)
    assert own_minutes(facts(world)) is None


def test_the_bmu_is_quoted_only_while_current_flows() -> None:
    world = settled(soc_pct=50.0, time_to_full_min=83.0)
    assert bmu_minutes(facts(world)) == pytest.approx(83.0, abs=1)
    world.ask(Request.STOP)
    world.until(State.HELD)
    assert bmu_minutes(facts(world)) is None
