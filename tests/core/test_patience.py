"""What looks like a fault and is none: rows that must wait or look twice, and what they must not wait for."""

import pytest

from orchestrator.core.checks import state_of_charge
from orchestrator.core.facts import Facts
from orchestrator.model import State
from orchestrator.sim.pack import Pack
from tests.core.bays import charging
from tests.core.world import TICK_S, World


def fault_ids(world: World, begin: int) -> set[str]:
    return {fault.id for decision in world.decisions[begin:] for fault in decision.faults}


def test_steady_values_of_a_steady_battery_are_not_frozen() -> None:
    """Cells on the flat part of their curve, and a supply that regulates well: the same digits for an hour."""
    world = charging()
    world.values["voltage_v"] = 48.19  # a slightly bad contact
    world.run(3600, dt_s=1.0)
    assert world.is_in(State.CHARGING)
    assert not world.raised


def test_a_charger_that_moves_with_the_battery_is_not_frozen() -> None:
    world = charging()
    for step, volts in enumerate(range(480, 540, 5)):
        world.values |= {"voltage_v": volts / 10, "soc_pct": 50.0 + 4 * step}
        world.run(59, dt_s=1.0)
    assert not fault_ids(world, 0)


def until_limit(world: World, step: int, **battery: float) -> None:
    world.values.update(battery)
    for _ in range(round(120 / TICK_S)):
        if world.tick() and world.charger.limit == step:
            return
    raise AssertionError(f"step {step} was not ordered: {world.decision}")


def step_down(late_s: float) -> World:
    """From 14 A to 8 A, with a current that follows this much later."""
    world = charging()
    world.amps = 14.0
    until_limit(world, 2, soc_pct=90.0)
    for _ in range(round(late_s / TICK_S)):
        world.tick()
    world.amps = None
    world.run(3)
    return world


@pytest.mark.parametrize(("late_s", "tripped"), [(0.0, False), (1.0, False), (1.5, True)])
def test_after_a_step_down_the_current_has_a_second_to_follow(late_s: float, *, tripped: bool) -> None:
    world = step_down(late_s)
    assert ("over_current" in world.raised) is tripped


def test_the_step_before_excuses_no_more_than_it_allowed() -> None:
    world = charging()
    until_limit(world, 2, soc_pct=90.0)
    world.amps = 15.8
    world.run(2 * TICK_S)
    assert "over_current" in world.raised


def test_a_step_up_excuses_nothing() -> None:
    world = World(temperature_c=14.0).charging()
    until_limit(world, 4, temperature_c=16.5)
    world.amps = 15.8
    world.run(2 * TICK_S)
    assert "over_current" in world.raised


def test_a_soc_that_creeps_is_not_doubted() -> None:
    world = charging()
    for soc in (50.0, 54.0, 55.0, 53.5):
        world.values["soc_pct"] = soc
        world.run(800, dt_s=1.0)
    assert not fault_ids(world, 0)


def test_a_battery_that_is_seen_to_leave_may_be_followed_by_any_other() -> None:
    world = charging()
    world.leave()
    world.run(40)
    world.arrive(soc_pct=90.0)
    begin = len(world.decisions)
    world.until(State.CHARGING)
    assert "battery_exchanged" not in fault_ids(world, begin)
    assert "soc_jump" not in fault_ids(world, begin)


def test_a_bmu_that_was_not_heard_may_have_gone_on_counting() -> None:
    world = charging()
    world.battery_answers = False
    world.run(600, dt_s=1.0)
    world.arrive(soc_pct=70.0)
    world.until(State.CHARGING)
    assert "battery_exchanged" not in fault_ids(world, 0)


@pytest.mark.parametrize("soh_pct", [60.0, 100.0])
@pytest.mark.parametrize("amps", [2.0, 14.0])
def test_the_figures_of_a_healthy_pack_agree_all_the_way_up(amps: float, soh_pct: float) -> None:
    pack = Pack(soh_pct=soh_pct)
    world = charging()
    world.amps = amps
    for soc_pct in range(1, 99):
        pack.set_soc(soc_pct)
        pack.advance(0.1, amps)
        told = pack.readout()
        assert told.time_to_full_min is not None
        world.volts = None
        world.values.update(
            soc_pct=float(round(told.soc_pct)), voltage_v=told.voltage_v, remaining_ah=told.remaining_ah,
            available_wh=told.available_wh, time_to_full_min=float(round(told.time_to_full_min)),
        )  # fmt: skip
        world.tick()
        assert (
            state_of_charge.figures_disagree(Facts.of(world.now_s, world.snapshot(None, ""), world.memory, world.rules))
            is None
        )
