"""What looks like a fault and is none: rows that have to wait, or to look twice, and what they may not wait for."""

import pytest

from orchestrator.model import State
from tests.core.bays import charging
from tests.core.world import TICK_S, World


def fault_ids(world: World, begin: int) -> set[str]:
    return {fault.id for decision in world.decisions[begin:] for fault in decision.faults}


def test_steady_values_of_a_steady_battery_are_not_frozen() -> None:
    """Cells on their flat part, and a supply that regulates well: the same digits for an hour."""
    world = charging()
    world.values["voltage_v"] = 48.19  # a bad contact more or less
    world.run(3600, dt_s=1.0)
    assert world.is_in(State.CHARGING)
    assert not world.raised


def test_a_charger_that_moves_with_the_battery_is_not_frozen() -> None:
    world = charging()
    for volts in range(480, 540, 5):
        world.values["voltage_v"] = volts / 10
        world.run(59, dt_s=1.0)
    assert not fault_ids(world, 0)


def until_limit(world: World, step: int, **battery: float) -> None:
    world.values.update(battery)
    for _ in range(round(120 / TICK_S)):
        if world.tick() and world.charger.limit == step:
            return
    raise AssertionError(f"step {step} was not ordered: {world.decision}")


def step_down(late_s: float) -> World:
    """From 14 A to 8 A, with a current that follows so much later."""
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
    world = World(temperature_c=9.0).charging()
    until_limit(world, 4, temperature_c=10.5)
    world.amps = 15.8
    world.run(2 * TICK_S)
    assert "over_current" in world.raised
