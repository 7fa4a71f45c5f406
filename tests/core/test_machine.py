"""Every state × every trigger, and what must hold for the table whatever else changes."""

import ast
from itertools import product
from pathlib import Path

import pytest

from orchestrator.core import machine, next_transition
from orchestrator.core.machine import MACHINE, TABLE, Trigger, fire
from orchestrator.core.states import ENERGISED
from orchestrator.errors import RefusedError
from orchestrator.model import State

#: What each trigger does in each state: where it leads; `=`: it stays; `·`: refused, and the state is unchanged.
MATRIX = """
                      stop      give_up         lose     rest  hold  suspend    fill  trip     reset  qualify     pulse            continue              charge
STARTING              =         UNCONTROLLABLE  OFFLINE  IDLE  HELD  SUSPENDED  FULL  TRIPPED  ·      ·           ·                ·                     ·
OFFLINE               STOPPING  ·               =        IDLE  HELD  SUSPENDED  FULL  TRIPPED  ·      ·           ·                ·                     ·
IDLE                  STOPPING  ·               OFFLINE  =     HELD  SUSPENDED  FULL  ·        ·      QUALIFYING  ·                ·                     ·
HELD                  STOPPING  ·               OFFLINE  IDLE  =     SUSPENDED  FULL  ·        ·      QUALIFYING  ·                ·                     ·
QUALIFYING            STOPPING  ·               OFFLINE  IDLE  HELD  SUSPENDED  FULL  ·        ·      ·           PRECHARGE_PULSE  ·                     CHARGING
PRECHARGE_PULSE       STOPPING  ·               ·        ·     ·     ·          ·     ·        ·      ·           ·                PRECHARGE_CONTINUOUS  ·
PRECHARGE_CONTINUOUS  STOPPING  ·               ·        ·     ·     ·          ·     ·        ·      ·           ·                ·                     CHARGING
CHARGING              STOPPING  ·               ·        ·     ·     ·          ·     ·        ·      ·           ·                ·                     ·
FULL                  STOPPING  ·               OFFLINE  IDLE  HELD  SUSPENDED  =     ·        ·      QUALIFYING  ·                ·                     ·
SUSPENDED             STOPPING  ·               OFFLINE  IDLE  HELD  =          FULL  ·        ·      QUALIFYING  ·                ·                     ·
STOPPING              =         UNCONTROLLABLE  OFFLINE  IDLE  HELD  SUSPENDED  FULL  TRIPPED  ·      ·           ·                ·                     ·
TRIPPED               STOPPING  ·               ·        ·     ·     ·          ·     ·        HELD   ·           ·                ·                     ·
UNCONTROLLABLE        =         ·               OFFLINE  IDLE  HELD  SUSPENDED  FULL  TRIPPED  ·      ·           ·                ·                     ·
"""  # noqa: E501 - a matrix that is read as a whole


def _outcomes() -> dict[tuple[State, Trigger], str]:
    header, *rows = (line.split() for line in MATRIX.strip().splitlines())
    return {
        (State(row[0]), Trigger(trigger)): outcome
        for row in rows
        for trigger, outcome in zip(header, row[1:], strict=True)
    }


OUTCOMES = _outcomes()


def test_the_matrix_has_every_pair_once() -> None:
    assert set(OUTCOMES) == set(product(State, Trigger))
    assert len(MATRIX.strip().splitlines()) == 1 + len(State)


@pytest.mark.parametrize(("state", "trigger"), list(product(State, Trigger)))
def test_every_pair_has_its_outcome(state: State, trigger: Trigger) -> None:
    expected = OUTCOMES[state, trigger]
    if expected == "·":
        with pytest.raises(RefusedError, match=f"{trigger} is not possible in {state}"):
            fire(state, trigger)
    else:
        assert fire(state, trigger) is (state if expected == "=" else State(expected))


def leads(state: State) -> dict[Trigger, State]:
    """The states that can follow."""
    return {trigger: target or state for trigger, sources, target in TABLE if state in sources and target is not state}


def test_no_pair_is_in_the_table_twice() -> None:
    pairs = [(source, trigger) for trigger, sources, _ in TABLE for source in sources]
    assert len(pairs) == len(set(pairs))


#: The only ways into a state in which current flows.
INTO = {
    State.PRECHARGE_PULSE: {State.QUALIFYING},
    State.PRECHARGE_CONTINUOUS: {State.PRECHARGE_PULSE},
    State.CHARGING: {State.QUALIFYING, State.PRECHARGE_CONTINUOUS},
}


def test_current_begins_only_after_qualifying() -> None:
    assert set(INTO) == ENERGISED
    into = {
        target: {source for source in State if target in leads(source).values() and source is not target}
        for target in ENERGISED
    }
    assert into == INTO


def test_current_ends_only_by_a_stop() -> None:
    for state in ENERGISED:
        out = {trigger: target for trigger, target in leads(state).items() if target not in ENERGISED}
        assert out == {Trigger.STOP: State.STOPPING}


def test_a_trip_is_entered_only_from_where_a_stop_was_just_verified() -> None:
    into = {state for state in State if State.TRIPPED in leads(state).values()}
    assert into == {State.STARTING, State.STOPPING, State.UNCONTROLLABLE, State.OFFLINE}


def test_a_trip_is_left_only_by_a_reset_or_a_stop() -> None:
    assert leads(State.TRIPPED) == {Trigger.RESET: State.HELD, Trigger.STOP: State.STOPPING}


def test_a_stop_is_possible_everywhere_and_never_lets_current_flow() -> None:
    for state in State:
        assert fire(state, Trigger.STOP) not in ENERGISED


@pytest.mark.parametrize("state", State)
def test_every_state_has_a_way_to_verified_standby(state: State) -> None:
    """… by two triggers at most: a stop, and the one that follows it."""
    nearby = {state, *leads(state).values()}
    nearby |= {target for near in nearby for target in leads(near).values()}
    assert State.IDLE in nearby


def test_no_state_is_a_dead_end_and_every_state_can_be_reached() -> None:
    reached, edge = {State.STARTING}, {State.STARTING}
    while edge:
        edge = {target for state in edge for target in leads(state).values()} - reached
        reached |= edge
    assert reached == set(State)
    assert all(set(leads(state).values()) - {state} for state in State)


def test_every_trigger_is_in_the_table_and_is_used() -> None:
    assert {trigger for trigger, _, _ in TABLE} == set(Trigger)
    source = ast.parse(Path(next_transition.__file__).read_text(encoding="utf-8"))
    used = {
        node.attr
        for node in ast.walk(source)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "Trigger"
    }
    assert used == {trigger.name for trigger in Trigger}


def test_triggers_of_rest_lead_where_the_course_believes() -> None:
    for trigger, state in next_transition.LEADS.items():
        assert {target for name, _, target in TABLE if name is trigger} == {state}


def test_the_engine_knows_no_triggers_but_ours() -> None:
    """`transitions` adds to_STATE for every state unless told not to."""
    assert set(MACHINE.events) == {trigger.value for trigger in Trigger}


def test_fire_keeps_nothing() -> None:
    """The machine has no model and no state of its own: the same question always gives the same answer."""
    for _ in range(2):
        with pytest.raises(RefusedError):
            fire(State.CHARGING, Trigger.REST)
        assert fire(State.IDLE, Trigger.QUALIFY) is State.QUALIFYING
    assert MACHINE.models == []
    assert machine.MACHINE.initial == State.STARTING.name


def test_a_refusal_names_both_and_has_no_foreign_cause() -> None:
    with pytest.raises(RefusedError) as refused:
        fire(State.TRIPPED, Trigger.QUALIFY)
    assert str(refused.value) == "qualify is not possible in TRIPPED"
    assert refused.value.__suppress_context__
