"""A service that stood still has heard nobody: it says so, and blames no device for it."""

from dataclasses import replace

import pytest

from orchestrator.core.facts import ANSWER_S
from orchestrator.core.states import AT_REST, ENERGISED, ordered
from orchestrator.model import STOP, Action, Command, State
from tests.core.bays import IN
from tests.core.said import reason_of
from tests.core.world import World

SILENCES = frozenset({"charger_silent", "bmu_silent", "heartbeat_lost", "stale_reading", "will_not_start"})


def stands_still(world: World, seconds: float) -> None:
    """The whole service; the devices go on, but their newest reports are that old."""
    world.ours, world.port_hangs, world.battery_answers = {"late_s": seconds}, True, False
    world.tick(seconds)
    world.ours = {}


def goes_on(world: World) -> None:
    world.port_hangs, world.battery_answers = False, True


@pytest.mark.parametrize("seconds", [1.6, 2.5, 6.0, 600.0])
@pytest.mark.parametrize("state", ordered(ENERGISED | {State.QUALIFYING}))
def test_a_stall_explains_itself(state: State, seconds: float) -> None:
    world = IN[state]()
    stands_still(world, seconds)
    assert world.decision.command == STOP
    assert world.is_in(State.STOPPING)
    assert "nobody looked at this bay" in reason_of(world.decision)
    world.tick()
    goes_on(world)
    world.until(State.SUSPENDED, 3)
    assert "nobody looked at this bay" in reason_of(world.decision)
    world.run(5)
    assert State.OFFLINE not in world.states()
    assert not SILENCES & world.memory.faults.keys(), "not even a strike"
    assert len(world.memory.faults["overrun"].strikes) == 1


@pytest.mark.parametrize("state", ordered(AT_REST - {State.QUALIFYING}))
def test_a_stall_at_rest_moves_nothing(state: State) -> None:
    world = IN[state]()
    world.run(2)
    before = world.state
    number = len(world.decisions)
    stands_still(world, 6.0)
    assert world.decision.command == STOP, "its charger has not been seen for so long"
    world.run(0.5)
    goes_on(world)
    world.run(5)
    assert {decision.state for decision in world.decisions[number:]} == {before}


@pytest.mark.parametrize("state", [State.IDLE, State.SUSPENDED, State.FULL])
def test_whoever_does_not_answer_after_the_stall_is_silent(state: State) -> None:
    world = IN[state]()
    stands_still(world, 6.0)
    world.charger_answers = False
    world.run(ANSWER_S + 0.5)
    assert world.is_in(State.OFFLINE)


def test_a_charger_that_is_gone_after_the_stall_is_out_of_control_in_time() -> None:
    world = IN[State.CHARGING]()
    stands_still(world, 6.0)
    world.charger_answers = False
    world.run(3.0)
    assert world.is_in(State.UNCONTROLLABLE)


def test_a_battery_that_is_gone_after_the_stall_is_told() -> None:
    world = IN[State.CHARGING]()
    stands_still(world, 6.0)
    world.port_hangs = False
    world.run(ANSWER_S + 0.5)
    assert world.is_in(State.OFFLINE)
    world.run(1)
    assert "BMU" in reason_of(world.decision)


def test_no_setting_counts_as_disobeyed_for_a_time_in_which_nobody_looked() -> None:
    world = IN[State.CHARGING]()
    sequence = replace(world.memory.sequence, command=Command(Action.SET_LIMIT, 2), command_s=world.now_s)
    world.memory = replace(world.memory, sequence=sequence)
    stands_still(world, 6.0)
    assert set(world.raised) <= {"late", "overrun"}
