"""The end of a charge: how full is known, what is not believed, the hold at the top, a full charge now and then."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.config.load import load_policy
from orchestrator.config.policy import Needs, Policy, Taper
from orchestrator.core.finish import DAY_S
from orchestrator.core.persisted import Persisted
from orchestrator.model import ChargeMode, Operation, Request, State
from tests.core.said import reason_of
from tests.core.world import POLICY, TICK_S, World, bay, with_full

S = State


def finishing(**changes: Any) -> Policy:
    return replace(POLICY, finish=replace(POLICY.finish, **changes))


def tapering(world: World, amps: float = 0.9) -> None:
    world.values.update(voltage_v=54.0, soc_pct=97.0)
    world.amps = amps


def test_a_soc_that_is_not_trusted_ends_nothing() -> None:
    """A BMU that reads 8 % too high left the pack at 92 %."""
    world = World(bay(with_full(soc_pct=None))).charging()
    for soc_pct in range(55, 101, 5):
        world.values["soc_pct"] = float(soc_pct)
        world.run(1)
    world.run(600)
    assert world.is_in(S.CHARGING)
    tapering(world)
    world.values["soc_pct"] = 100.0
    world.until(S.FULL, 130)


def test_a_low_step_is_no_taper() -> None:
    """On a step that is itself as low as a taper, a cold pack was called full at 15 %."""
    taper = Taper(below_a=5.0, above_v=53.6, for_s=10)
    world = World(bay(with_full(soc_pct=None, taper=taper)), temperature_c=5.0).charging()
    world.values.update(voltage_v=54.0, soc_pct=90.0)
    assert world.charger.limit == 0
    world.run(600)
    assert world.is_in(S.CHARGING), "2 A flow on a step of 2 A: that is no taper"
    world.amps = 0.99
    world.until(S.FULL, 12)


def test_a_taper_is_one_of_one_step() -> None:
    """Less current because of a lower step is no taper."""
    taper = Taper(below_a=5.0, above_v=53.6, for_s=30)
    world = World(bay(with_full(soc_pct=None, taper=taper)), soc_pct=85.0, temperature_c=17.0).charging()
    world.values.update(voltage_v=54.0)
    world.amps = 4.9
    world.run(29)
    world.values["temperature_c"] = 14.0
    world.tick()
    assert world.memory.stage.step is not None
    assert world.memory.stage.step.index == 0
    world.amps = 0.9
    world.run(29)
    assert world.is_in(S.CHARGING)


def test_a_charger_that_ends_the_hold_of_a_full_pack_ends_the_charge() -> None:
    """Whatever the policy thinks of the charger's word, the pack was already found full."""
    for changes in ({"charger": False}, {"needs": Needs.ALL, "charger": False}, {"needs": Needs.ALL, "charger": None}):
        full_by = replace(POLICY.finish.full, soc_pct=90.0, **changes)
        world = World(bay(finishing(full=full_by, hold_min=30))).charging()
        tapering(world)
        world.run(130)
        assert world.is_in(S.CHARGING)
        assert world.memory.session is not None
        assert world.memory.session.full is not None
        world.amps, world.values["voltage_v"] = 5.0, 53.0  # nothing looks like the end any more
        world.run(15)
        world.shows.update(charge_mode=ChargeMode.FULL, operation=Operation.STOPPED)
        world.until(S.FULL, 3)
        assert "stopped_by_itself" not in world.memory.faults


def test_a_charger_whose_word_the_policy_does_not_take_is_told_so() -> None:
    """The current had tapered off at the end voltage: that it had not would be untrue."""
    world = World(bay(with_full(charger=False, soc_pct=100.0, taper=None))).charging()
    tapering(world)
    world.run(20)
    world.shows.update(charge_mode=ChargeMode.FULL, operation=Operation.STOPPED)
    world.until(S.HELD, 3)
    said = reason_of(world.decision)
    assert "the policy does not take its mode 5 for full (" in said, said
    assert "taper" not in said


def test_all_that_is_needed_must_be_there() -> None:
    world = World(bay(with_full(needs=Needs.ALL))).charging()
    world.values["soc_pct"] = 96.0
    world.run(1)
    tapering(world)
    world.run(130)
    assert world.is_in(S.CHARGING), "97 % is not 100 %"
    world.values["soc_pct"] = 100.0
    assert reason_of(world.tick()).startswith("step")
    assert POLICY.finish.full.charger
    world.shows.update(charge_mode=ChargeMode.FULL, operation=Operation.STOPPED)
    world.until(S.FULL, 3)


def test_what_does_not_stand_there_is_not_needed() -> None:
    world = World(bay(with_full(needs=Needs.ALL, charger=None))).charging()
    world.values["soc_pct"] = 96.0
    world.run(1)
    tapering(world)
    world.run(130)
    assert world.is_in(S.CHARGING)
    world.values["soc_pct"] = 100.0
    reason = reason_of(world.tick())
    assert reason.startswith("full: SOC 100 % reached 100 %")
    assert " and 0.90 A, tapered below 1 A for 120 s" in reason


# --- held at the top --------------------------------------------------------------------------------------------------


def held() -> World:
    world = World(bay(finishing(hold_min=30))).charging()
    world.values["soc_pct"] = 97.0
    world.run(1)
    tapering(world)
    world.run(125)
    return world


def test_a_full_pack_stays_on_to_balance() -> None:
    world = held()
    assert world.is_in(S.CHARGING)
    assert reason_of(world.decision).endswith(
        f"held at the top for another 30 min ({POLICY.source.at('finish.hold_min')})"
    )
    world.amps = 1.5  # a balancer takes more for a while: the pack stays full
    world.run(30 * 60 - 10)
    assert world.is_in(S.CHARGING)
    world.until(S.FULL, 10)
    assert ", held for 30 min (" in next(reason_of(d) for d in reversed(world.decisions) if d.state is S.STOPPING)


def test_a_pause_does_not_begin_the_hold_anew() -> None:
    world = held()
    world.run(20 * 60)
    assert world.memory.session is not None
    before_s = world.memory.session.held_s
    world.ask(Request.PAUSE)
    world.until(S.SUSPENDED)
    world.run(60)
    assert world.memory.session.held_s == pytest.approx(before_s, abs=2 * TICK_S)
    world.ask(Request.START)
    world.charging()
    world.until(S.FULL, 10 * 60 + 5)


def test_a_charger_that_ends_by_itself_ends_the_hold() -> None:
    world = held()
    world.shows.update(charge_mode=ChargeMode.FULL, operation=Operation.STOPPED)
    world.until(S.FULL, 3)
    assert set(world.raised) <= {"soc_jump"}


# --- all the way, every so many days ----------------------------------------------------------------------------------


def long_life() -> Policy:
    policy = finishing(target_soc_pct=80.0, full_every_days=14.0)
    return replace(
        policy, start=replace(POLICY.start, soc_below_pct=75), recharge=replace(POLICY.recharge, soc_below_pct=60)
    )


def at_target() -> World:
    world = World(bay(long_life())).charging()
    for soc_pct in range(55, 81, 5):
        world.values["soc_pct"] = float(soc_pct)
        world.run(1)
    world.until(S.FULL, 5)
    return world


def test_a_target_ends_the_charge() -> None:
    world = at_target()
    world.run(600)
    assert world.is_in(S.FULL)


def test_once_in_so_many_days_it_goes_all_the_way() -> None:
    world = at_target()
    world.now_s += 14 * DAY_S
    world.until(S.CHARGING, 30)
    world.values["soc_pct"] = 85.0
    world.run(30)
    assert world.is_in(S.CHARGING)
    for soc_pct in (90.0, 95.0, 99.0, 100.0):
        world.values["soc_pct"] = soc_pct
        world.run(1)
    world.until(S.FULL, 10)
    world.run(60)
    assert world.is_in(S.FULL), "the next one is two weeks away"
    assert world.memory.battery.full_s is not None
    assert world.now_s - world.memory.battery.full_s < 120


def interrupted_at(world: World, soc_pct: float) -> None:
    """A person pauses the charge, and the BMU corrects its SOC meanwhile."""
    world.ask(Request.PAUSE)
    world.until(S.SUSPENDED)
    world.values["soc_pct"] = soc_pct
    world.run(5)
    world.ask(Request.START)
    world.run(20)


def test_a_pause_does_not_end_a_charge_that_is_due_to_go_all_the_way() -> None:
    """It has passed the target, and the target does not count today."""
    world = at_target()
    world.now_s += 14 * DAY_S
    world.until(S.CHARGING, 30)
    world.values["soc_pct"] = 85.0
    world.run(5)
    interrupted_at(world, 86.0)
    assert world.is_in(S.CHARGING), world.decision


@pytest.mark.parametrize(("soc_pct", "state"), [(79.0, S.CHARGING), (80.0, S.IDLE)])
def test_a_charge_that_was_interrupted_goes_on_to_its_target(soc_pct: float, state: State) -> None:
    """Neither the threshold for a new charge (75 %) ends it, nor does it pass the target to find the pack full."""
    policy, full = long_life(), replace(POLICY.finish.full, soc_pct=None)
    world = World(bay(replace(policy, finish=replace(policy.finish, full=full)))).charging()
    world.values["soc_pct"] = 78.0
    world.run(5)
    interrupted_at(world, soc_pct)
    assert world.is_in(state), world.decision


def test_the_days_are_counted_over_a_restart_and_over_a_departure() -> None:
    world = at_target()
    world.now_s += 10 * DAY_S
    world.run(1)
    kept = Persisted.of(world.memory, world.now_s)
    assert kept.full == pytest.approx(10 * DAY_S, abs=120)
    world.memory = kept.aged(4 * DAY_S).memory(world.now_s)
    world.until(S.CHARGING, 60)
    world.values["soc_pct"] = 85.0
    world.run(30)
    assert world.is_in(S.CHARGING)


def test_a_battery_that_was_never_charged_here_is_not_due() -> None:
    world = World(bay(long_life())).charging()
    assert world.memory.battery.full_s is not None
    for soc_pct in range(55, 81, 5):
        world.values["soc_pct"] = float(soc_pct)
        world.run(1)
    world.until(S.FULL, 5)


# --- derived limits ---------------------------------------------------------------------------------------------------


def test_hours_and_ah_follow_from_the_capacity() -> None:
    world = World(bay(load_policy("li-ion-48v", changes={"finish.max_ah": "null", "pack.capacity_ah": "20"})))
    assert world.rules.max_ah == pytest.approx(22.0)
    assert world.rules.max_hours == pytest.approx(15.0), "20 Ah at 2 A, and half as much again"


def test_a_pack_that_has_lost_some_is_not_full_any_more() -> None:
    """A pause that another reason prolonged does not end the next charge as it begins."""
    world = held()
    world.ask(Request.PAUSE)
    world.until(S.SUSPENDED)
    for soc_pct in range(95, 49, -3):
        world.values["soc_pct"] = float(soc_pct)
        world.run(2)
    world.amps = None
    world.ask(Request.START)
    world.charging()
    world.run(40 * 60, dt_s=1.0)
    assert world.is_in(S.CHARGING)


def interrupted(world: World) -> None:
    world.ask(Request.PAUSE)
    world.until(S.SUSPENDED)
    world.values["soc_pct"] = 100.0
    world.run(30)
    world.ask(Request.START)


def test_a_hold_that_was_interrupted_goes_on_at_100_percent() -> None:
    world = held()
    interrupted(world)
    world.charging()
    world.run(20 * 60, dt_s=1.0)
    assert world.is_in(S.CHARGING)


def test_a_charge_that_was_interrupted_is_not_over_by_a_soc_that_is_not_trusted() -> None:
    """Otherwise a pause would let a BMU that reads too high end it after all."""
    world = World(bay(with_full(soc_pct=None)), soc_pct=97.0).charging()
    interrupted(world)
    world.charging()
    assert world.is_in(S.CHARGING)
    tapering(world)
    world.values["soc_pct"] = 100.0
    world.until(S.FULL, 130)


def test_a_charge_that_found_the_pack_full_counts_for_the_days() -> None:
    world = World(bay(long_life()), soc_pct=70.0).charging()
    world.run(DAY_S / 24, dt_s=1.0)
    tapering(world)
    world.values["soc_pct"] = 78.0
    world.until(S.FULL, 130)
    assert world.memory.battery.full_s is not None
    assert world.now_s - world.memory.battery.full_s < 10
