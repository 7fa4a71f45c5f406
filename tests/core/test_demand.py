"""A bay on a supply: what it asks for, what its charger counts with, and how it obeys what is granted."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.core import demand, limits, rows
from orchestrator.core.facts import Facts
from orchestrator.core.limits import choose, supplied
from orchestrator.core.machine import Trigger
from orchestrator.core.next_transition import next_transition
from orchestrator.core.resting import resting_place, unsupplied
from orchestrator.core.rules import Bound
from orchestrator.core.supply import Want
from orchestrator.model import ActiveFault, Cause, ControlMode, Decision, Effect, State
from tests.core.bays import POLICY
from tests.core.edges import STANDS_BY, UNHEARD, Edge, witnessed

S = State
FULL = Cause.of("supply_full", key="supplies.hall.limit_w", place="s.yaml:9", supply="hall", used_w=990, limit_w=999)
WAITS = Cause.of("waits_for_supply", key=FULL.key, place=FULL.place, what=FULL)


def granted(level: int | None) -> dict[str, Any]:
    return {"granted": level, "granted_why": None if level is None else FULL}


# --- what it asks for -------------------------------------------------------------------------------------------------


def in_its_rows(f: Facts) -> Facts:
    """With the rows of the policy's tables that the values are in."""
    return f.with_memory(replace(f.memory, tables=rows.update(f)))


def wants(f: Facts) -> Want:
    return demand.want(in_its_rows(f), Decision(f.memory.state, f.memory.cause))


WANTS = (
    Edge(wants, Want(5)),
    Edge(wants, Want(3), bmu={"soc_pct": 95.0}),
    Edge(wants, Want(1), bmu={"temperature_c": 5.0}),
    Edge(wants, Want(1), bmu={"temperature_c": None}),
    Edge(wants, Want(5, keeps=True), bmu={"voltage_v": 53.6}),
    Edge(wants, Want(5), bmu={"voltage_v": None}),
    Edge(wants, Want(1, keeps=True), state=S.PRECHARGE_PULSE),
    Edge(wants, Want(1), control=ControlMode.AUTOMATIC),
    Edge(wants, Want(5), state=S.QUALIFYING, charger=STANDS_BY),
    Edge(wants, Want(5), {"cause": WAITS}, state=S.SUSPENDED, charger=STANDS_BY),
    Edge(wants, Want(5), {"cause": WAITS}, state=S.STOPPING, charger=STANDS_BY),
    Edge(wants, Want(), state=S.SUSPENDED, charger=STANDS_BY),
    Edge(wants, Want(), state=S.FULL, charger=STANDS_BY),
    Edge(wants, Want(5), policy=replace(POLICY, finish=replace(POLICY.finish, full=replace(POLICY.finish.full,
         taper=None)), pack=replace(POLICY.pack, capacity_ah=None)), bmu={"voltage_v": 53.6}),
)  # fmt: skip


def test_a_fault_that_limits_is_no_want() -> None:
    f = in_its_rows(Edge(wants, None).facts)
    fault = ActiveFault("noisy_line", Effect.LIMIT, 1.0, lambda: pytest.fail("nobody reads it"))
    assert demand.want(f, Decision(S.CHARGING, Cause("charging"), faults=(fault,))) == Want(1)


# --- what its charger counts with -------------------------------------------------------------------------------------

COUNTS = (
    Edge(demand.level, 5),
    Edge(demand.level, 3, charger={"current_step": 2, "current_a": 8.0}, bmu={"current_a": 8.0}),
    Edge(demand.level, 5, charger={"current_step": 2, "current_a": 12.5}, bmu={"current_a": 8.0}),
    Edge(demand.level, 4, charger={"current_step": 2, "current_a": 8.0}, bmu={"current_a": 9.2}),
    Edge(demand.level, 5, charger={"current_step": 2, "current_a": 99.0}),
    Edge(demand.level, 1, charger={"current_step": 0, "current_a": 2.5}, bmu={"current_a": None}),
    Edge(demand.level, 5, charger={"current_step": None, "current_a": 2.0}, bmu={"current_a": 2.0}),
    Edge(demand.level, 1, control=ControlMode.AUTOMATIC),
    Edge(demand.level, None, charger=UNHEARD),
    Edge(demand.level, None, charger_link={"online": False}),
    Edge(demand.level, None, state=S.STARTING),
    Edge(demand.level, None, state=S.UNCONTROLLABLE),
    Edge(demand.level, 0, state=S.IDLE, charger=STANDS_BY),
    Edge(demand.level, 0, witnessed(), S.STOPPING, charger=STANDS_BY),
    Edge(demand.level, 5, state=S.STOPPING, charger=STANDS_BY),  # its stop is not proved yet
    Edge(demand.level, 5, charger=STANDS_BY),  # it has been told to run
)  # fmt: skip

# --- how it obeys -----------------------------------------------------------------------------------------------------

OTHER = Bound(8.0, "current.soc_pct.rows[1]")


def least(f: Facts) -> Bound:
    return supplied(f, OTHER)


def goes(f: Facts) -> tuple[Trigger | None, Cause]:
    return next_transition(f, ())[:2]


def steps(f: Facts) -> tuple[int, Cause]:
    chosen, _ = choose(in_its_rows(f), None)
    return chosen.index, chosen.rule


OBEYS = (
    Edge(least, OTHER, snapshot=granted(None)),
    Edge(least, OTHER, snapshot=granted(3)),
    Edge(least, Bound(5.0, FULL.key), snapshot=granted(2)),
    Edge(least, Bound(0.0, FULL.key), snapshot=granted(0)),
    Edge(least, OTHER, snapshot=granted(5)),
    Edge(least, OTHER, snapshot={"granted": 2}),
    Edge(steps, (1, FULL), snapshot=granted(2)),
    Edge(limits.none_allowed, None, snapshot=granted(0)),  # that is no fault
    Edge(unsupplied, None, snapshot=granted(None)),
    Edge(unsupplied, None, snapshot=granted(1)),
    Edge(unsupplied, (Trigger.SUSPEND, WAITS), snapshot=granted(0)),
    Edge(unsupplied, None, snapshot={"granted": 0}),
    Edge(goes, (Trigger.STOP, WAITS), snapshot=granted(0)),
    Edge(goes, (Trigger.STOP, WAITS), state=S.PRECHARGE_PULSE, snapshot=granted(0)),
    Edge(goes, (Trigger.SUSPEND, WAITS), state=S.IDLE, charger=STANDS_BY, snapshot=granted(0)),
    Edge(goes, (Trigger.SUSPEND, WAITS), state=S.QUALIFYING, charger=STANDS_BY, snapshot=granted(0)),
    Edge(goes, (None, WAITS), state=S.SUSPENDED, charger=STANDS_BY, snapshot=granted(0)),
)


@pytest.mark.parametrize("edge", (*WANTS, *COUNTS, *OBEYS), ids=lambda edge: edge.name)
def test_at_the_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_a_bay_that_wants_nothing_waits_for_nothing() -> None:
    f = Edge(goes, None, {"full_pct": 100.0}, S.FULL, charger=STANDS_BY, bmu={"soc_pct": 99.0}).facts
    waiting = replace(f, snapshot=replace(f.snapshot, **granted(0)))
    assert resting_place(waiting, ()) == resting_place(f, ())
