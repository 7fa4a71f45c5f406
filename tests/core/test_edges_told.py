"""What people are told of faults and of their requests, at its edges: the whole cause, with every figure."""

from typing import Any

import pytest

from orchestrator.core.active import active_faults, evidence, times
from orchestrator.core.acts import MAX_RESETS, act, refused_for
from orchestrator.core.failed import carry_on
from orchestrator.core.faults import ROW
from orchestrator.core.memory import FaultMemory, Memory, Operator
from orchestrator.core.operator import PAUSED, STOPPED, Heard, handle_request
from orchestrator.core.safestop import LASTS_S
from orchestrator.model import Alarm, Cause, Request, Snapshot, State
from orchestrator.model.cause import together
from tests.core.edges import NOW_S, Edge, ago
from tests.core.said import cause
from tests.core.world import remembering

S = State
SEEN = cause("what was seen")


def fault(raised_s: float = 200, gone_s: float | None = None, **more: Any) -> FaultMemory:
    """Raised so long ago, and gone for so long; None: it is still there."""
    clean_s = None if gone_s is None else ago(gone_s)
    return FaultMemory(present=gone_s is None, raised_s=ago(raised_s), clean_s=clean_s, cause=SEEN, **more)


def bay(state: State = S.SUSPENDED, resets: tuple[tuple[float, str], ...] = (), **faults: FaultMemory) -> Memory:
    return remembering(state=state, since_s=0.0, last_s=NOW_S, faults=faults, resets=resets)


def gone(seconds: float) -> Cause:
    return Cause.of("gone", gone_t_s=ago(seconds))


# --- a fault that ends by itself --------------------------------------------------------------------------------------

HOT: dict[str, Any] = {"over_temperature": fault()}
GOES_ON, CLEARS = (Cause.of(f"{verb}_after", wait_s=10, strike=None) for verb in ("goes_on", "clears"))


@pytest.mark.parametrize(
    ("memory", "says"),
    [
        (bay(**HOT), GOES_ON),
        (bay(S.CHARGING, **HOT), GOES_ON),
        (bay(S.IDLE, **HOT), CLEARS),
        (remembering(bay(**HOT), hold=STOPPED), CLEARS),
        (remembering(bay(**HOT), paused=True), CLEARS),
        (bay(not_persisted=fault(), **HOT), GOES_ON),
        (bay(emergency=fault(), **HOT), CLEARS),
    ],
)
def test_only_a_bay_that_waits_for_nothing_else_goes_on(memory: Memory, says: Cause) -> None:
    assert act(memory, NOW_S, "bay-1", "over_temperature") == says


@pytest.mark.parametrize(("state", "says"), [(S.SUSPENDED, GOES_ON), (S.CHARGING, CLEARS)])
def test_a_fault_that_only_prevents_a_start_does_not_stop_a_charge(state: State, says: Cause) -> None:
    assert act(bay(state, not_persisted=fault()), NOW_S, "bay-1", "not_persisted") == says


def test_a_lesser_fault_that_waits_for_a_person_keeps_the_bay_waiting() -> None:
    """The silent charger is the worse of two with the same effect, so it is told first."""
    after = Cause.of("clears_after", wait_s=20.0, strike=Cause.of("strike", number=1, of=3))
    memory = bay(emergency=fault(), charger_silent=fault(strikes=(ago(200),)))
    assert act(memory, NOW_S, "bay-1", "charger_silent") == after


def test_a_backoff_says_which_strike_it_is() -> None:
    memory = bay(charger_silent=fault(strikes=(ago(900), ago(200))))
    after = Cause.of("goes_on_after", wait_s=70.0, strike=Cause.of("strike", number=2, of=3))
    assert act(memory, NOW_S, "bay-1", "charger_silent") == after


@pytest.mark.parametrize(
    ("state", "others", "id_", "left_s", "until_s"),
    [
        (S.IDLE, {}, "clears_in", 7, NOW_S + 6.5),
        (S.SUSPENDED, {}, "goes_on_in", 7, NOW_S + 6.5),
        (S.SUSPENDED, {"not_persisted": fault(gone_s=1.5)}, "goes_on_in", 9, NOW_S + 8.5),
        (S.SUSPENDED, {"not_persisted": fault(gone_s=9.5)}, "goes_on_in", 7, NOW_S + 6.5),
        (S.SUSPENDED, {"not_persisted": fault()}, "goes_on_in_at_the_earliest", 7, NOW_S + 6.5),
        (S.SUSPENDED, {"noisy_line": fault()}, "goes_on_in", 7, NOW_S + 6.5),
        (S.IDLE, {"not_persisted": fault(gone_s=1.5)}, "clears_in", 7, NOW_S + 6.5),
    ],
)
def test_a_fault_that_is_gone_counts_down(
    state: State, others: dict[str, Any], id_: str, left_s: int, until_s: float
) -> None:
    memory = bay(state, over_temperature=fault(gone_s=3.5), **others)
    says = Cause.of(id_, gone=gone(3.5), left_s=left_s, until_t_s=until_s, strike=None)
    assert act(memory, NOW_S, "bay-1", "over_temperature") == says


@pytest.mark.parametrize(("seconds", "left_s"), [(9, 1), (10, 0), (11, 0)])
def test_no_countdown_is_negative(seconds: float, left_s: int) -> None:
    told = act(bay(over_temperature=fault(gone_s=seconds)), NOW_S, "bay-1", "over_temperature")
    assert told.param("left_s") == left_s


# --- a fault that a person ends ---------------------------------------------------------------------------------------


def often(name: str) -> tuple[tuple[float, str], ...]:
    """As many resets as are allowed."""
    return tuple((ago(300 - n), name) for n in range(MAX_RESETS))


LOCKED = Cause.of("reset_locked", until_t_s=ago(300) + 3600, times=3)


@pytest.mark.parametrize(
    ("name", "latched", "request_"), [("reverse_polarity", True, "reset"), ("emergency", False, "start")]
)
def test_out_of_control_nothing_is_asked_for_before_a_lasting_standby(name: str, latched: bool, request_: str) -> None:
    known: dict[str, Any] = {name: fault(latched=latched)}
    memory = bay(S.UNCONTROLLABLE, **known)
    says = Cause.of("after_standby", request=request_, lasts_s=LASTS_S)
    assert act(memory, NOW_S, "bay-1", name, out=True) == says


@pytest.mark.parametrize(
    ("name", "known", "resets", "says"),
    [
        ("reverse_polarity", fault(latched=True), (), Cause.of("refused_while", request="reset")),
        ("reverse_polarity", fault(latched=True), often("reverse_polarity"),
         Cause.of("refused_while", request="reset", then=LOCKED)),
        ("reverse_polarity", fault(gone_s=5, latched=True), (), None),
        ("reverse_polarity", fault(gone_s=4.5, latched=True), (),
         Cause.of("refused_for", request="reset", gone=gone(4.5), left_s=1)),
        ("reverse_polarity", fault(gone_s=3.5, latched=True), (),
         Cause.of("refused_for", request="reset", gone=gone(3.5), left_s=2)),
        ("reverse_polarity", fault(gone_s=3.5, latched=True), often("reverse_polarity"), LOCKED),
        ("reverse_polarity", fault(gone_s=5, latched=True), often("reverse_polarity"), LOCKED),
        ("reverse_polarity", fault(gone_s=5, latched=True), often("emergency"), None),
        ("emergency", fault(gone_s=5), often("emergency"), None),
    ],
)  # fmt: skip
def test_why_a_reset_is_refused(
    name: str, known: FaultMemory, resets: tuple[tuple[float, str], ...], says: Cause | None
) -> None:
    memory = remembering(bay(S.TRIPPED, resets), faults={name: known})
    assert refused_for(memory, NOW_S, name, Request.RESET) == says


def refused(memory: Memory, request: Request) -> Cause:
    refusal = handle_request(memory, request, NOW_S).refusal
    assert refusal is not None
    return refusal


def test_a_refused_start_names_the_command_for_the_bay() -> None:
    """Without a name for the bay, its place is held."""
    memory = bay(S.TRIPPED, will_not_stop=fault(gone_s=5, latched=True))
    refusal = refused(memory, Request.START)
    assert refusal.param("then") == Cause.of("reset_now", gone=gone(5), bay="BAY")
    assert refusal.param("what").advice == "will_not_stop", "nobody has said that it stands by"


def test_a_reset_is_refused_for_what_is_there_not_for_what_waits_besides() -> None:
    memory = bay(S.TRIPPED, often("error_stop"), reverse_polarity=fault(latched=True),
                 error_stop=fault(gone_s=5, latched=True))  # fmt: skip
    assert refused(memory, Request.RESET).param("fault") == "reverse_polarity"


# --- pauses and starts ------------------------------------------------------------------------------------------------


def by(who: str) -> Cause:
    return Cause.of("paused_by", who=who)


@pytest.mark.parametrize(
    ("before", "told", "after"),
    [
        (None, None, None),
        (None, by("Ann"), by("Ann")),
        (by("Ann"), by("Ben"), together([by("Ann"), by("Ben")])),
        (by("Ann"), by("Ann"), by("Ann")),
        (by("Ann"), None, together([by("Ann"), PAUSED])),
    ],
)
def test_everybody_who_pauses_is_remembered(before: Cause | None, told: Cause | None, after: Cause | None) -> None:
    memory = remembering(bay(), paused=before is not None, paused_by=before)
    heard = handle_request(memory, Request.PAUSE, NOW_S, by=told)
    assert heard == Heard(Operator(paused=True, paused_by=after), {})


def test_a_start_ends_hold_and_pause() -> None:
    memory = remembering(bay(S.HELD), hold=STOPPED, paused=True, paused_by=by("Ann"))
    assert handle_request(memory, Request.START, NOW_S) == Heard(Operator(), {})


# --- the evidence -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "known", "says"),
    [
        ("implausible", fault(strikes=(1.0,)), SEEN.with_("implausible", effect="STOP")),
        ("implausible", fault(strikes=(1.0,), latched=True), SEEN.with_("implausible", effect="TRIP")),
        ("implausible", fault(strikes=(1.0, 2.0), latched=True),
         SEEN.with_("implausible", effect="TRIP", strikes=2)),
        ("implausible", fault(strikes=(1.0, 2.0)), SEEN.with_("implausible", effect="STOP")),
        ("implausible", fault(gone_s=5), SEEN.with_("implausible", effect="STOP", past=True)),
        ("implausible", FaultMemory(raised_s=1.0), Cause("implausible").with_("implausible", effect="STOP")),
        ("over_temperature", fault(gone_s=5), SEEN.with_(effect="PAUSE", past=True)),
        ("will_not_stop", fault(latched=True), SEEN.with_("will_not_stop", effect="TRIP")),
    ],
)  # fmt: skip
def test_what_was_seen_and_what_to_do(name: str, known: FaultMemory, says: Cause) -> None:
    assert evidence(ROW[name], known) == says


def test_a_stop_that_was_denied_has_another_advice_at_rest() -> None:
    advice = [evidence(ROW["will_not_stop"], fault(latched=True), at_rest=rest).advice for rest in (False, True)]
    assert advice == ["will_not_stop", "stands_by_now"]


VOLTS = Cause.of("volts_disagree", charger_v=53.0, pack_v=48.0, wrong=None)


def test_the_figures_now_are_told_only_if_all_are_known() -> None:
    known = FaultMemory(raised_s=1.0, clean_s=2.0, cause=VOLTS)
    row, raised_s = ROW["volts_disagree"], ("raised_t_s", 1.0)
    now = tuple(Cause.of("figure_v", value=volts) for volts in (48.0, 47.0))
    heard, unheard = (Edge(bool, True, bmu={"voltage_v": pack_v}).facts for pack_v in (47.0, None))
    assert times(row, known) == (raised_s,)
    assert times(row, known, heard) == (raised_s, ("now", now))
    assert times(row, known, unheard) == (raised_s,)


def test_an_active_fault_carries_the_evidence_as_it_was_raised() -> None:
    (active,) = active_faults(bay(implausible=fault(now=cause("what is seen"))), NOW_S, "bay-1")
    assert (active.raised, active.since_s, active.gone_s) == (SEEN, ago(200), None)


# --- our own failure --------------------------------------------------------------------------------------------------


def test_our_own_failure_opens_the_contactor_of_a_charger_that_may_not_stand_by() -> None:
    stopping = remembering(bay(S.STOPPING), closed=True, stopping_s=ago(1))
    decision, memory = carry_on(NOW_S, Snapshot(), stopping, "error")
    assert (decision.closed, memory.closed, decision.alarm) == (True, True, Alarm.NONE)
    out = remembering(bay(S.STOPPING), closed=True, stopping_s=ago(3))
    decision, memory = carry_on(NOW_S, Snapshot(), out, "error")
    assert (decision.closed, memory.closed, decision.alarm) == (False, False, Alarm.DANGER)


@pytest.mark.parametrize("who", [None, Cause.of("stopped_by", who="Ann")])
def test_a_stop_is_remembered_with_its_person_though_we_fail(who: Cause | None) -> None:
    _, memory = carry_on(NOW_S, Snapshot(request=Request.STOP, asked_by=who), bay(S.CHARGING), "error")
    assert memory.operator == Operator(hold=who or STOPPED)


def test_other_faults_count_down_though_we_fail() -> None:
    decision, _ = carry_on(NOW_S, Snapshot(), bay(over_temperature=fault(gone_s=3.5)), "error")
    told = {one.id: one.next for one in decision.faults}
    assert told["over_temperature"] == Cause.of(
        "clears_in", gone=gone(3.5), left_s=7, until_t_s=NOW_S + 6.5, strike=None
    )
