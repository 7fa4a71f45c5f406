"""Where a bay goes, and what a decision answers, at their edges: the whole reason, and everything that changes."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.core.active import active_faults
from orchestrator.core.decide import decide
from orchestrator.core.facts import Facts
from orchestrator.core.machine import Trigger
from orchestrator.core.memory import FaultMemory, Memory, Stage
from orchestrator.core.next_transition import next_transition
from orchestrator.core.resting import resting_place
from orchestrator.model import (
    Cause,
    CurrentStep,
    Decision,
    Request,
    Session,
    State,
)
from tests.core.bays import POLICY
from tests.core.edges import NOW_S, STANDS_BY, UNHEARD, Edge, ago, by_policy, witnessed
from tests.core.said import cause

S = State
OPEN = {"session": Session(0.0)}
EARLIER = cause("the reason before")

# --- from one state to the next ---------------------------------------------------------------------------------------


def goes(f: Facts) -> tuple[Trigger | None, Cause, object]:
    """Where a bay goes, why, and what changes with it."""
    trigger, why, changes = next_transition(f, ())
    return trigger, why, tuple(changes.items())


def qualifying(seconds: float, **more: Any) -> dict[str, Any]:
    return {"ran": False, "runs_s": None, "qualified_s": ago(seconds), **witnessed(), **more}


def ready(*, intends: bool = True) -> object:
    return (("stage", Stage(qualified_s=ago(2), ready=True, intends=intends)),)


def qualifies(says: object, seconds: float = 2.0, **more: Any) -> Edge:
    return Edge(goes, says, qualifying(seconds), S.QUALIFYING, charger=STANDS_BY, **more)


ITS_TURN = Cause.of("another_begins", bay="bay-2")
PULSES = by_policy("needs_pulses", "precharge.below_v", pack_v=38.9, below_v=39.0)
QUALIFYING = (
    qualifies((None, Cause("checking"), (("stage", Stage(qualified_s=ago(1.9))),)), 1.9),
    qualifies((None, ITS_TURN, ready(intends=False)), snapshot={"waits": ITS_TURN}),
    qualifies((None, Cause("writing_down"), ready()), snapshot={"running_persisted": False}),
    qualifies((Trigger.PULSE, PULSES, ready()), bmu={"voltage_v": 38.9, "soc_pct": 2.0}),
    qualifies((Trigger.CHARGE, Cause.of("qualified", pack_v=39.0, soc_pct=2.0, pack_c=20.0), ready()),
              bmu={"voltage_v": 39.0, "soc_pct": 2.0}),
    qualifies((Trigger.CHARGE, Cause.of("qualified", pack_v=48.0, soc_pct=50.0, pack_c=20.0), ready())),
)  # fmt: skip

WANTS = by_policy("soc_below", "start.soc_below_pct", soc_pct=50.0, threshold_pct=98.0)
NOT_HEARD = Cause.of("battery_not_heard", charger_v=48.0, what=Cause.of("bmu_does_not_answer", node_id=0x10))


def kept(**more: Any) -> dict[str, Any]:
    return {"cause": EARLIER, **more}


ASLEEP: dict[str, Any] = {"charger": STANDS_BY, "bmu_link": {"online": False}}
GOES = (
    # a stop that is verified
    Edge(goes, (Trigger.REST, WANTS, ()), witnessed(), S.STOPPING, charger=STANDS_BY),
    Edge(goes, (None, EARLIER, ()), kept(stalled_s=ago(1), **witnessed()), S.STOPPING, 1.25, **ASLEEP),
    Edge(goes, (Trigger.LOSE, NOT_HEARD, ()), kept(stalled_s=ago(1), **witnessed()), S.STOPPING, 1.5, **ASLEEP),
    Edge(goes, (Trigger.LOSE, NOT_HEARD, ()), kept(**witnessed()), S.STOPPING, 1.25, **ASLEEP),
    Edge(goes, (None, EARLIER, ()), kept(), S.STOPPING, 1.25, charger=STANDS_BY),
    # at rest, right after this service stood still
    Edge(goes, (None, EARLIER, ()), kept(stalled_s=ago(1)), S.IDLE, charger=UNHEARD),
    Edge(goes, (None, EARLIER, ()), kept(stalled_s=ago(1)), S.IDLE, **ASLEEP),
    Edge(goes, (Trigger.LOSE, NOT_HEARD, ()), kept(), S.IDLE, **ASLEEP),
)  # fmt: skip

# --- at rest ----------------------------------------------------------------------------------------------------------


def rests(f: Facts) -> tuple[Trigger, Cause]:
    faults = active_faults(f.memory, f.now_s, f.rules.bay.name, f, at_rest=True)
    return resting_place(f, faults)


ENDING = cause("a new version")
ENDS = Cause.of("service_ends", why=ENDING)
FORTNIGHTLY = replace(POLICY, finish=replace(POLICY.finish, target_soc_pct=80.0, full_every_days=14.0))
FULL_BY_TARGET = {"full_pct": 80.0, "full_s": ago(14 * 86400.0)}
DUE = by_policy("soc_below", "finish.full_every_days", soc_pct=50.0, threshold_pct=98.0)


def rest(says: object, memory: dict[str, Any], state: State = S.IDLE, **more: Any) -> Edge:
    return Edge(rests, says, memory, state, charger=STANDS_BY, **more)


RESTS = (
    rest((Trigger.QUALIFY, WANTS), {}),
    rest((Trigger.REST, ENDS), {}, snapshot={"ending": ENDING}),
    rest((Trigger.SUSPEND, ENDS), OPEN, S.SUSPENDED, snapshot={"ending": ENDING}),
    rest((Trigger.QUALIFY, DUE), FULL_BY_TARGET, S.FULL, policy=FORTNIGHTLY),
)  # fmt: skip

#: The pack was too cold, down to -4 °C; that ended a second ago, and it has 20 °C now.
WAS_COLD = by_policy("under_temperature", "pack.temperature_c", pack_c=-3.0, limit_c=0.0, again_c=3.0)
COLD = FaultMemory(raised_s=ago(60), clean_s=ago(1), cause=WAS_COLD, worst=-4.0)


def degrees(value: float) -> Cause:
    return Cause.of("figure_c", value=value)


@pytest.mark.parametrize("state", [S.IDLE, S.FULL, S.SUSPENDED])
def test_a_fault_at_rest_is_told_as_where_the_bay_waits(state: State) -> None:
    """With what it is now beside what it was, and when the bay goes on."""
    goes_on = Cause.of("goes_on_in", gone=Cause.of("gone", gone_t_s=ago(1)), left_s=9, until_t_s=NOW_S + 9, strike=None)
    told = WAS_COLD.with_(
        effect="PAUSE", past=True, raised_t_s=ago(60), worst=Cause.of("down_to", figure=degrees(-4.0)),
        now=(degrees(20.0),), then=goes_on,
    )  # fmt: skip
    f = Edge(rests, None, {"faults": {"under_temperature": COLD}}, state, charger=STANDS_BY).facts
    assert rests(f) == (Trigger.SUSPEND, told)


# --- a whole decision -------------------------------------------------------------------------------------------------


def decided(f: Facts) -> tuple[Decision, Memory]:
    return decide(f.now_s, f.snapshot, f.memory, f.rules)


def answer(f: Facts) -> Cause | None:
    """Why the request was refused."""
    return decided(f)[0].answer


FULL_DISK, FOREIGN = cause("the disk is full"), {"locked_by": Cause("program_unknown")}
LOCKED = Cause("port_was_locked")
DENIED = FaultMemory(
    present=True, raised_s=ago(60), clean_s=ago(9), latched=True, cause=Cause.of("did_not_stop", lasted_s=4.0)
)  # fmt: skip
RESET_NOW = Cause.of("reset_now", gone=Cause.of("gone", gone_t_s=ago(9)), bay="bay-1")
TO_RESET = Cause.of(
    "refused",
    fault="will_not_stop",
    why=Cause.of("needs_reset", request="start"),
    what=Cause.of("did_not_stop", advice="stands_by_now", lasted_s=4.0, effect="TRIP", past=True, raised_t_s=ago(60)),
    then=RESET_NOW,
)


def asks(request: Request | None, says: Cause | None, memory: dict[str, Any], state: State, **more: Any) -> Edge:
    snapshot = {"request": request, **more.pop("snapshot", {})}
    return Edge(answer, says, memory, state, charger=STANDS_BY, snapshot=snapshot, **more)


HELD = {"hold": EARLIER}
ANSWERS = (
    asks(Request.START, None, HELD, S.HELD),
    asks(Request.START, Cause.of("not_done", advice="not_persisted", problem=FULL_DISK), HELD, S.HELD,
         snapshot={"not_persisted": FULL_DISK}),
    asks(Request.STOP, None, HELD, S.HELD, snapshot={"not_persisted": FULL_DISK}),
    asks(Request.START, TO_RESET, {"faults": {"will_not_stop": DENIED}}, S.TRIPPED),
    # a port that another program has
    asks(Request.START, LOCKED, HELD, S.HELD, charger_link=FOREIGN),
    asks(Request.STOP, None, HELD, S.HELD, charger_link=FOREIGN),
    asks(None, None, HELD, S.HELD, charger_link=FOREIGN),
    asks(Request.PAUSE, Cause.of("not_running", what=EARLIER), HELD, S.HELD, charger_link=FOREIGN),
)  # fmt: skip

EDGES = (*QUALIFYING, *GOES, *RESTS, *ANSWERS)


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: edge.name)
def test_where_a_bay_goes_at_its_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


@pytest.mark.parametrize(("late_s", "stalled_s"), [(1.0, None), (1.01, NOW_S)])
def test_a_bay_that_nobody_looked_at_for_longer_than_a_second_stood_still(late_s: float, stalled_s: float) -> None:
    _, memory = decided(Edge(answer, None, state=S.IDLE, charger=STANDS_BY, snapshot={"late_s": late_s}).facts)
    assert memory.stalled_s == stalled_s


@pytest.mark.parametrize(("last_s", "energised_s"), [(None, 7.0), (ago(0.25), 7.25)])
def test_no_time_counts_before_the_first_decision(last_s: float | None, energised_s: float) -> None:
    decision, _ = decided(Edge(answer, None, {"session": Session(0.0, energised_s=7.0), "last_s": last_s}).facts)
    assert decision.session is not None
    assert decision.session.energised_s == energised_s


#: On step 3 and allowed to go up, or on step 5 and to go down.
UP = {"step": CurrentStep(2, 8.0, EARLIER), "raise_s": ago(60), "limit": 2}
DOWN = {"step": CurrentStep(4, 14.0, EARLIER), "limit": 4}
ROWS = (("temperature_c", 2), ("soc_pct", 0), ("soh_pct", 1))


@pytest.mark.parametrize(
    ("before", "shown", "soc_pct", "index", "row_returns"),
    [(UP, 2, 50.0, 4, ()), (DOWN, 4, 95.0, 2, (("current.soc_pct.rows[1]", 1),))],
    ids=["up", "down"],
)
def test_another_step_is_confirmed_anew_and_counted_if_it_is_lower(
    before: dict[str, Any], shown: int, soc_pct: float, index: int, row_returns: object
) -> None:
    memory = {**before, "session": Session(0.0), "confirmed": True, "rows": ROWS}
    decision, after = decided(
        Edge(answer, None, memory, charger={"current_step": shown}, bmu={"soc_pct": soc_pct}).facts
    )
    assert decision.step is not None
    assert (decision.step.index, after.charger.confirmed) == (index, False)
    assert after.tables.row_returns == row_returns
    assert after.session is not None
    assert after.session.step_changes == 1


def test_a_charge_that_a_fault_ends_says_so_even_if_a_person_holds_the_bay() -> None:
    """The charger was not heard when it was raised, and is in standby again."""
    memory = {**HELD, **OPEN, "faults": {"will_not_stop": DENIED}, **witnessed()}
    decision, _ = decided(
        Edge(answer, None, memory, S.OFFLINE, charger=STANDS_BY, charger_link={"stop_sent_s": ago(1)}).facts
    )
    assert decision.state is S.TRIPPED
    assert decision.session is not None
    assert decision.session.result == decision.cause
    assert decision.cause.id == "several"
