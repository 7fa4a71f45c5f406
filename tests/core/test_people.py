"""Who stopped or paused a bay is carried along: it changes what people read, and nothing that is decided."""

from dataclasses import replace

import pytest

from orchestrator.core.memory import FaultMemory, Memory, with_values
from orchestrator.core.operator import MOST_PEOPLE, PAUSED, STOPPED, handle_request, is_own, pause, stopped
from orchestrator.core.persisted import Persisted
from orchestrator.model import Alarm, Cause, Request, State
from orchestrator.model.cause import parts
from tests.core.said import reason_of, say
from tests.core.world import World

START = "; to go on: orchestrator start bay-1"


def by(who: str, id_: str = "stopped_by", **more: str) -> Cause:
    return Cause.of(id_, who=who, asked_at="21:09", **more)


@pytest.mark.parametrize(("request_", "id_"), [(Request.STOP, "stopped_by"), (Request.PAUSE, "paused_by")])
def test_the_reason_names_the_person_and_the_words(request_: Request, id_: str) -> None:
    named, unnamed = World().charging(), World().charging()
    verb = id_.removesuffix("_by")
    for _ in range(40):
        mine = named.tick(request=request_, asked_by=by("kim", id_, because="wet floor"))
        theirs = unnamed.tick(request=request_)
        assert replace(mine, cause=theirs.cause, session=theirs.session) == theirs, "the same but for the words"
        request_ = None  # type: ignore[assignment]  # only once
    assert reason_of(named.decision) == f"{verb} by kim at 21:09: wet floor{START}"
    assert reason_of(unnamed.decision) == f"{verb} by the operator{START}"


def test_a_named_stop_is_no_alarm() -> None:
    world = World().charging()
    world.tick(request=Request.STOP, asked_by=by("kim"))
    world.until(State.HELD)
    assert world.decision.alarm is Alarm.NONE


def test_nobody_s_stop_is_lost_by_another_s() -> None:
    known = World().memory.operator
    for who in ("kim", "lee", "kim"):
        known = stopped(known, by(who, because=f"{who} says so"))
    assert say(known.hold) == "stopped by lee at 21:09: lee says so; stopped by kim at 21:09: kim says so"
    assert known.hold is not None and is_own(known.hold)
    for number in range(20):
        known = stopped(known, by(f"user{number}"))
    assert known.hold is not None and len(parts(known.hold)) == MOST_PEOPLE
    assert stopped(World().memory.operator).hold == STOPPED


def test_a_reset_leaves_a_person_s_stop_and_a_start_ends_it() -> None:
    tripped = {"status_trip": FaultMemory(raised_s=0.0, clean_s=0.0, latched=True, cause=Cause("unfinished"))}
    for hold, after in ((by("kim"), by("kim")), (None, by("lee", "reset_by")), (STOPPED, by("lee", "reset_by"))):
        memory = with_values(Memory(), hold=hold, faults=tripped)
        heard = handle_request(memory, Request.RESET, 1000.0, by=by("lee", "reset_by"))
        assert (heard.refusal, heard.operator.hold) == (None, after)
    world = World().charging()
    world.tick(request=Request.STOP, asked_by=by("kim"))
    world.tick(request=Request.START, asked_by=by("lee", "started_by"))
    assert world.memory.operator.hold is None


def test_both_outlive_a_restart_and_older_files_have_neither() -> None:
    world = World().charging()
    world.tick(request=Request.PAUSE, asked_by=by("kim", "paused_by"))
    kept = Persisted.of(world.memory, world.now_s)
    assert kept.paused_by == by("kim", "paused_by") and kept.gist != replace(kept, paused_by=None).gist
    assert pause(kept.memory(5.0).operator) == by("kim", "paused_by")
    assert pause(replace(kept, paused_by=None).memory(5.0).operator) == PAUSED
    world.tick(request=Request.START)
    assert world.memory.operator.paused_by is None
