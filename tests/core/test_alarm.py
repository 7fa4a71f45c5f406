"""The levels of alarm: danger, attention, none."""

import pytest

from orchestrator.core.alarm import alarm
from orchestrator.core.faults import FAULTS, Clear, FaultRow
from orchestrator.core.operator import RESET, STOPPED
from orchestrator.model import Account, ActiveFault, Alarm, Cause, Request, State
from orchestrator.text.catalogue import advise
from tests.core.bays import IN, held, idle, running_at_the_start, tripped
from tests.core.said import reason_of
from tests.core.world import remembering

ADVICE = [advise(row.id) for row in FAULTS if row.clear is Clear.OPERATOR]


def test_the_worst_of_many_is_the_highest() -> None:
    assert max(Alarm.ATTENTION, Alarm.DANGER, Alarm.NONE) is Alarm.DANGER
    assert sorted(Alarm) == [Alarm.NONE, Alarm.ATTENTION, Alarm.DANGER]


@pytest.mark.parametrize("state", State)
def test_every_state_has_its_level(state: State) -> None:
    levels = {State.TRIPPED: Alarm.ATTENTION, State.UNCONTROLLABLE: Alarm.DANGER}
    assert IN[state]().tick().alarm is levels.get(state, Alarm.NONE)


@pytest.mark.parametrize(
    ("hold", "level"),
    [(STOPPED, Alarm.NONE), (RESET, Alarm.NONE), (Cause("past_unknown"), Alarm.ATTENTION)],
)
def test_who_holds_a_bay_knows_of_it(hold: Cause, level: Alarm) -> None:
    assert alarm(remembering(state=State.HELD, hold=hold), ()) is level
    assert alarm(remembering(state=State.STOPPING, hold=hold), ()) is Alarm.NONE


@pytest.mark.parametrize("row", FAULTS, ids=[row.id for row in FAULTS])
def test_a_fault_that_waits_for_a_start_wants_attention(row: FaultRow) -> None:
    fault = ActiveFault(row.id, row.effect, 0.0, lambda: Account(Cause(row.id)))
    level = alarm(remembering(state=State.HELD, hold=STOPPED), (fault,))
    waits = Alarm.ATTENTION if row.clear is Clear.OPERATOR else Alarm.NONE
    assert level is (Alarm.DANGER if row.id == "port_locked" else waits)


def test_a_charger_that_was_found_running_wants_a_person() -> None:
    world = running_at_the_start()
    decision = world.until(State.HELD)
    assert decision.alarm is Alarm.ATTENTION
    assert "find out who started it, then start; gone since " in reason_of(decision)
    assert reason_of(decision).endswith(": orchestrator start bay-1")
    world.ask(Request.STOP)
    world.run(1)
    assert world.decision.alarm is Alarm.ATTENTION  # whatever else holds it
    world.ask(Request.START)
    world.until(State.CHARGING, 10)
    assert world.tick().alarm is Alarm.NONE


def test_a_reset_ends_the_attention_and_leaves_the_start_to_a_person() -> None:
    world = tripped()
    assert world.ask(Request.RESET) == ""
    before = world.decision
    assert (before.state, before.alarm) == (State.HELD, Alarm.NONE)
    assert reason_of(before) == "reset by the operator; to go on: orchestrator start bay-1"
    assert reason_of(world.tick()) == reason_of(before)


@pytest.mark.parametrize("advice", ADVICE)
def test_what_waits_for_a_start_ends_its_advice_with_it(advice: str) -> None:
    """The command follows, and is named once."""
    assert advice.endswith(" start")


def test_a_held_bay_without_a_battery_goes_to_idle_when_it_is_started() -> None:
    world = held()
    world.leave()
    world.run(5)
    assert world.is_in(State.HELD)
    world.ask(Request.START)
    assert (world.state, reason_of(world.decision)) == (State.IDLE, "no battery")


def test_a_bay_with_nothing_to_do_can_be_held_too() -> None:
    world = idle()
    world.ask(Request.STOP)
    assert (world.state, world.decision.command) == (State.HELD, None)
    world.ask(Request.START)
    assert world.state is State.IDLE
