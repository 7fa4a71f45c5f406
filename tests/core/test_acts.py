"""No dead end: each fault says what ends it, and a request is answered accordingly."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest

from orchestrator.core.active import active_faults
from orchestrator.core.acts import MAX_RESETS
from orchestrator.core.checks.state_of_charge import STEP_NEWS_S
from orchestrator.core.faults import DANGERS, FAULTS, RANK, ROW, Clear, FaultRow
from orchestrator.core.latches import BACKOFF_S
from orchestrator.core.memory import FaultMemory, Memory, with_values
from orchestrator.core.operator import handle_request
from orchestrator.model import ActiveFault, Cause, Effect, Request, State
from orchestrator.text.catalogue import LANGUAGES, say
from tests.core.bays import charging
from tests.core.said import cause, reason_of
from tests.core.world import World, remembering

NOW_S = 10_000.0
#: The causes that name a command, that refuse one, and that say that the fault ends by itself.
COMMANDS = {"start_now": Request.START, "reset_now": Request.RESET}
REFUSED = {"refused_while", "refused_until", "refused_for", "reset_locked", "waits_for_fault"}
BY_ITSELF = {
    "goes_on_after", "goes_on_after_last", "goes_on_in", "goes_on_in_at_the_earliest", "clears_after",
    "clears_after_last", "clears_in", "counts_until",
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One row, its phase, and the state of its bay."""

    row: FaultRow
    stage: str
    state: State

    @property
    def fault(self) -> FaultMemory:
        latched = self.row.clear is Clear.RESET or self.stage in ("latched", "latched, gone", "locked")
        gone_s = NOW_S - 100 if self.stage in ("gone", "latched, gone", "locked") else None
        return FaultMemory(
            present=gone_s is None, raised_s=NOW_S - 200, clean_s=NOW_S - 1 if self.stage == "just gone" else gone_s,
            cause=cause("evidence"), now=None if gone_s else cause("evidence"), latched=latched,
            strikes=(NOW_S - 200,) * (len(BACKOFF_S) + latched) if self.row.clear is Clear.BACKOFF else (),
        )  # fmt: skip

    @property
    def memory(self) -> Memory:
        resets = tuple((NOW_S - 300 + n, self.row.id) for n in range(MAX_RESETS)) if self.stage == "locked" else ()
        return remembering(state=self.state, faults={self.row.id: self.fault}, resets=resets, since_s=0.0, last_s=NOW_S)

    def __str__(self) -> str:
        return f"{self.row.id}, {self.stage}, {self.state}"


def cases(row: FaultRow) -> Iterator[Case]:
    can_latch = row.clear in (Clear.RESET, Clear.BACKOFF)
    stages = ["present", "just gone", "gone", *(["latched", "latched, gone", "locked"] if can_latch else [])]
    for stage in stages:
        for state in (State.CHARGING, State.SUSPENDED, State.HELD, State.TRIPPED, State.IDLE):
            yield Case(row, stage, state)


def shown(memory: Memory) -> ActiveFault:
    (fault,) = active_faults(memory, NOW_S, "bay-1")
    return fault


def with_fault(memory: Memory, name: str, fault: FaultMemory) -> Memory:
    return with_values(memory, faults={**memory.faults, name: fault})


#: A test for each row, with all its cases: a test for each of some thousand would cost more than what it looks at.
every_row = pytest.mark.parametrize("row", FAULTS, ids=lambda row: row.id)


@every_row
def test_every_fault_ends_with_an_act_and_the_act_is_true(row: FaultRow) -> None:
    for case in cases(row):
        ends_with_a_true_act(case)


def ends_with_a_true_act(case: Case) -> None:
    fault = shown(case.memory)
    ends = fault.next
    assert ends is not None
    assert ends.id in {*COMMANDS, *REFUSED, *BY_ITSELF}
    for language in LANGUAGES:
        assert say(fault.told, language).endswith(say(ends, language))
        assert say(ends, language) != say(ends, "en") or language == "en"
    if ends.id in BY_ITSELF:
        assert fault.effect is not Effect.TRIP
        return
    for request in (Request.START, Request.RESET):
        answer = handle_request(case.memory, request, NOW_S, bay="bay-1").refusal
        if COMMANDS.get(ends.id) is request:
            assert answer is None, say(answer)
        elif ends.param("request") == request.value or (ends.id, request) == ("reset_locked", Request.RESET):
            assert answer is not None
            for language in LANGUAGES:
                assert say(ends, language) in say(answer, language)
                assert case.row.id in say(answer, language)


@every_row
def test_a_refusal_advises_what_the_status_advises_at_that_moment(row: FaultRow) -> None:
    for case in cases(row):
        advises_the_same(case)


def advises_the_same(case: Case) -> None:
    for at_rest in (False, True):
        (fault,) = active_faults(case.memory, NOW_S, "bay-1", at_rest=at_rest)
        for request in (Request.START, Request.RESET):
            answer = handle_request(case.memory, request, NOW_S, bay="bay-1", at_rest=at_rest).refusal
            what = answer.param("what") if answer is not None and answer.id == "refused" else None
            assert not isinstance(what, Cause) or what.advice == fault.told.advice


@every_row
def test_a_refusal_names_the_fault_its_evidence_and_what_ends_it(row: FaultRow) -> None:
    for case in cases(row):
        names_fault_evidence_and_end(case)


def names_fault_evidence_and_end(case: Case) -> None:
    for request in (Request.START, Request.RESET):
        answer = handle_request(case.memory, request, NOW_S, bay="bay-1").refusal
        if answer is None or answer.id.startswith("nothing_to_"):
            continue
        assert (answer.id, answer.param("fault")) == ("refused", case.row.id)
        ends = shown(case.memory).next
        assert ends is not None
        asked = ends if case.row.clear is not Clear.OPERATOR else replace(ends, params=(("request", request.value),))
        for language in LANGUAGES:
            assert "evidence" in say(answer, language)
            assert say(asked, language) in say(answer, language)


def test_out_of_control_no_command_is_named() -> None:
    for row in FAULTS:
        for stage in ("present", "gone"):
            fault = shown(Case(row, stage, State.UNCONTROLLABLE).memory)
            assert fault.next is not None
            assert fault.next.id in {*BY_ITSELF, "after_standby"}


def test_a_command_is_not_named_while_nothing_can_be_kept() -> None:
    memory = Case(ROW["hot_trip"], "gone", State.TRIPPED).memory
    full = cause("disk full")
    memory = with_fault(memory, "not_persisted", FaultMemory(present=True, raised_s=NOW_S - 9, cause=full, now=full))
    trip, _ = active_faults(memory, NOW_S, "bay-1")
    assert say(trip.next) == "gone since 9900 s, but reset is refused because of not_persisted"
    refused = handle_request(memory, Request.RESET, NOW_S, not_persisted=full).refusal
    assert say(refused) == "not done: disk full; make space, or mend the disk of the journal's directory"


def test_another_fault_in_the_way_is_named_instead_of_a_command() -> None:
    memory = Case(ROW["hot_trip"], "gone", State.TRIPPED).memory
    memory = with_fault(memory, "system_stop", Case(ROW["system_stop"], "present", State.TRIPPED).fault)
    trip, stop = active_faults(memory, NOW_S, "bay-1")
    assert say(trip.next) == "gone since 9900 s, but reset is refused because of system_stop"
    assert say(stop.next) == "reset is refused while it lasts"
    memory = with_fault(memory, "system_stop", Case(ROW["system_stop"], "gone", State.TRIPPED).fault)
    for fault in active_faults(memory, NOW_S, "bay-1"):
        assert say(fault.next).endswith(": orchestrator reset bay-1, then orchestrator start bay-1")


# --- a SOC that is not believed ---------------------------------------------------------------------------------------


def doubted() -> World:
    """Its SOC has jumped, and its figures have disagreed for long enough."""
    world = charging()
    world.amps = 0.5
    world.values |= {"remaining_ah": 10.0, "available_wh": 100.0}
    world.run(280, dt_s=1.0)
    world.values["soc_pct"] = 57.0
    world.run(40)
    assert world.is_in(State.HELD)
    assert "soc_not_believed" in world.raised
    return world


def test_a_soc_that_is_not_believed_says_why_and_until_when_a_start_is_refused() -> None:
    world = doubted()
    jump_s = world.memory.battery.charge_step[0] if world.memory.battery.charge_step else 0.0
    until_s = jump_s + STEP_NEWS_S + ROW["soc_jump"].clean_s
    why = f"is refused until {until_s:.0f} s, as long as what was seen counts"
    assert reason_of(world.decision).endswith(f"; start {why}")
    for request in (Request.START, Request.RESET):
        refused = world.ask(request)
        assert refused.startswith(f"soc_not_believed: {request.value} {why}: the SOC went from 50 to 57 % in ")
        assert "the BMU has 10.00 Ah and 100.0 Wh available" in refused
        assert "; have the BMU calibrated, then start" in refused
    while world.now_s < until_s - 1:
        world.tick(dt_s=0.5)
    assert world.ask(Request.START) != ""
    world.run(2)
    assert reason_of(world.decision).endswith(": orchestrator start bay-1")
    assert world.ask(Request.START) == ""


def test_where_one_of_the_doubts_is_gone_it_ends_sooner() -> None:
    world = doubted()
    world.values |= {"remaining_ah": None, "available_wh": None}
    world.run(1)
    gone_s = world.memory.faults["figures_disagree"].clean_s
    assert gone_s is not None
    assert f"start is refused until {gone_s + ROW['figures_disagree'].clean_s:.0f} s" in reason_of(world.decision)
    world.run(70)
    assert reason_of(world.decision).endswith(": orchestrator start bay-1")


# --- which one is shown first -----------------------------------------------------------------------------------------


def test_the_most_dangerous_is_told_first_however_old_the_others_are() -> None:
    faults = {
        name: FaultMemory(raised_s=raised_s, cause=cause(name), latched=True)
        for name, raised_s in (("ah_limit", 1.0), ("error_stop", 2.0), ("hot_trip", 3.0), ("will_not_stop", 4.0))
    }
    told = [fault.id for fault in active_faults(Memory(faults=faults), 9.0, "bay-1")]
    assert told == ["will_not_stop", "hot_trip", "error_stop", "ah_limit"]


def test_every_row_has_its_rank() -> None:
    assert RANK.keys() == ROW.keys()
    assert len(set(RANK.values())) == len(ROW)
    assert set(DANGERS) <= set(ROW)
