"""A bay that cannot be judged: everything that its memory and its decision then hold, part by part."""

from dataclasses import replace

import pytest

from orchestrator.core import safestop
from orchestrator.core.active import active_faults, unknown
from orchestrator.core.contactor import closes
from orchestrator.core.failed import carry_on
from orchestrator.core.faults import ROW, Clear
from orchestrator.core.history import stage
from orchestrator.core.memory import FaultMemory, Memory, Sequence, Stage, Stop, with_values
from orchestrator.core.operator import STOPPED
from orchestrator.core.safestop import OBEY_STOP_S
from orchestrator.model import STOP, Alarm, Cause, Decision, Effect, Request, Session, Snapshot, State

ERROR, AGAIN = "ZeroDivisionError() in step, line 1", "KeyError('x') in choose, line 2"
BEGAN_S = 50.0
HELD = Cause("port_was_locked")
GONE = FaultMemory(raised_s=1.0, clean_s=2.0, cause=Cause("stopped"), latched=True)
CHARGING = with_values(
    Memory(state=State.CHARGING, since_s=10.0, last_s=49.8, closed=True),
    ran=True, ready=True, intends=True, step=None, qualified_s=8.0, command=STOP, resumed=True,
    hold=HELD, session=Session(started_s=10.0), faults={"hot_trip": GONE},
)  # fmt: skip


def internal(error: str, raised_s: float = BEGAN_S) -> FaultMemory:
    what = Cause.of("internal_error", error=error)
    return FaultMemory(present=True, raised_s=raised_s, cause=what, latched=True, now=what)


def failed(now_s: float, memory: Memory, request: Request | None = None, error: str = ERROR) -> tuple[Decision, Memory]:
    return carry_on(now_s, Snapshot(request=request), memory, error, "bay-7")


def test_the_first_failure_begins_a_stop_and_keeps_what_is_known() -> None:
    decision, memory = failed(BEGAN_S, CHARGING)
    cause = Cause.of("failed_stopping", error=ERROR)
    assert memory == replace(
        CHARGING,
        state=State.STOPPING,
        cause=cause,
        since_s=BEGAN_S,
        last_s=BEGAN_S,
        closed=closes(State.STOPPING, closed=True, standby=False),
        faults={"hot_trip": GONE, "internal": internal(ERROR)},
        stop=Stop(unverified=True, stopping_s=BEGAN_S, stop_cause=Cause.of("failed", error=ERROR)),
        stage=Stage(ran=True, qualified_s=8.0),
        sequence=Sequence(resumed=True),
    )
    assert decision == Decision(
        State.STOPPING, cause, STOP, faults=active_faults(memory, BEGAN_S, "bay-7"), alarm=Alarm.NONE,
        closed=memory.closed, session=CHARGING.session,
    )  # fmt: skip


def test_further_failures_go_on_with_the_same_stop_until_it_has_been_in_vain() -> None:
    _, begun = failed(BEGAN_S, CHARGING)
    before_s = BEGAN_S + OBEY_STOP_S - 0.1
    decision, memory = failed(before_s, begun, error=AGAIN)
    assert memory == replace(
        begun,
        cause=Cause.of("failed_stopping", error=AGAIN),
        last_s=before_s,
        faults={**begun.faults, "internal": internal(AGAIN)},
    )
    assert (decision.state, decision.alarm) == (State.STOPPING, Alarm.NONE)
    end_s = BEGAN_S + OBEY_STOP_S
    decision, memory = failed(end_s, memory)
    cause = Cause.of("failed_uncontrollable", tried_s=OBEY_STOP_S, error=ERROR)
    assert memory == replace(
        begun,
        state=State.UNCONTROLLABLE,
        cause=cause,
        last_s=end_s,
        closed=False,
        faults={**begun.faults, "internal": internal(ERROR)},
    )
    assert (decision.state, decision.cause, decision.command) == (State.UNCONTROLLABLE, cause, STOP)
    assert (decision.alarm, decision.closed) == (Alarm.DANGER, False)


def test_one_out_of_control_stays_so() -> None:
    memory = with_values(Memory(state=State.UNCONTROLLABLE, since_s=40.0), stopping_s=BEGAN_S - 1.0)
    decision, after = failed(BEGAN_S, memory)
    assert (after.state, after.since_s) == (State.UNCONTROLLABLE, 40.0)
    assert after.stop == replace(memory.stop, unverified=True)
    assert decision.alarm is Alarm.DANGER


def test_a_stop_that_nobody_has_begun_begins() -> None:
    memory = Memory(state=State.STARTING, since_s=40.0)
    _, after = failed(BEGAN_S, memory)
    assert (after.state, after.since_s, after.stop.stopping_s) == (State.STOPPING, BEGAN_S, BEGAN_S)


@pytest.mark.parametrize("raised_s", [20.0, None])
def test_the_fault_counts_from_when_it_was_raised(raised_s: float | None) -> None:
    known = with_values(CHARGING, faults={"internal": FaultMemory(raised_s=raised_s, strikes=(1.0,))})
    _, after = failed(BEGAN_S, known)
    assert after.faults == {"internal": internal(ERROR, BEGAN_S if raised_s is None else raised_s)}


def test_a_stop_is_obeyed_and_everything_else_is_refused() -> None:
    decision, memory = failed(BEGAN_S, CHARGING, Request.STOP)
    assert (memory.operator.hold, decision.answer) == (STOPPED, None)
    for request in set(Request) - {Request.STOP}:
        decision, memory = failed(BEGAN_S, CHARGING, request)
        assert memory.operator == CHARGING.operator
        assert decision.answer == Cause.of("failed_request", error=ERROR)


# --- the parts, by the modules that make them -------------------------------------------------------------------------


def test_the_stop_is_not_proved() -> None:
    cause = Cause.of("failed", error=ERROR)
    before = Stop(stop_cause=Cause("stopped"), stopping_s=3.0, verified_s=2.0, returns=1)
    assert safestop.failed(before, 7.0, None) == replace(before, unverified=True)
    assert safestop.failed(before, 7.0, cause) == replace(before, unverified=True, stopping_s=7.0, stop_cause=cause)


@pytest.mark.parametrize(("ready", "intends"), [(True, True), (True, False), (False, True)])
def test_no_charge_is_about_to_begin(ready: bool, intends: bool) -> None:
    before = Stage(ran=True, qualified_s=8.0, ready=ready, intends=intends)
    assert stage.not_ready(before) == Stage(ran=True, qualified_s=8.0)
    assert stage.not_qualified(before) == Stage(ran=True)


def test_where_none_was_the_part_stays_the_same_object() -> None:
    before = Stage(ran=True, qualified_s=8.0)
    assert stage.not_ready(before) is before


def test_a_fault_of_another_version_trips_until_a_reset_and_nothing_looks_for_it() -> None:
    row = ROW["of_later"]
    assert (row.id, row.source, row.effect, row.clear) == ("of_later", "", Effect.TRIP, Clear.RESET)
    assert (row.where, row.moment) == (frozenset(), True)
    seen = Cause("stopped")
    assert unknown("of_later", seen) == Cause.of(
        "fault_of_another_version", fault="of_later", what=seen.with_(past=True)
    )
    assert unknown("of_later", None) == Cause.of("fault_of_another_version", fault="of_later", what=None)
