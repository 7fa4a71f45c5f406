"""How much current is allowed, and which rows are in force, at their edges: the whole bound, cause or part."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.config.policy import Policy
from orchestrator.core import limits, rows
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Tables
from orchestrator.core.parts import changed
from orchestrator.core.rules import Bound, Rules
from orchestrator.model import BatteryReading, Cause, ChargeMode, ControlMode, Operation, Session, State
from tests.core.bays import POLICY
from tests.core.edges import Edge, by_policy
from tests.core.world import bay

S = State
AUTOMATIC = ControlMode.AUTOMATIC
OPEN = {"session": Session(0.0)}

# --- how much is allowed ----------------------------------------------------------------------------------------------


def of_pack(current_a: float) -> Policy:
    return replace(POLICY, pack=replace(POLICY.pack, current_a=current_a))


def at_most(allowed_a: float) -> Cause:
    return by_policy("limit_pack", "pack.current_a", allowed_a=allowed_a)


def too_low(allowed_a: float) -> Cause:
    rule = at_most(allowed_a)
    return Cause.of("below_lowest_step", key=rule.key, place=rule.place, rule=rule, lowest_a=2.0)


WIDEST: dict[str, Any] = {"rows": (("temperature_c", 2), ("soc_pct", 0), ("soh_pct", 1))}
ALLOWED = (
    Edge(limits.none_allowed, None, WIDEST),
    Edge(limits.none_allowed, None, WIDEST, policy=of_pack(2.0)),
    Edge(limits.none_allowed, too_low(1.9), WIDEST, policy=of_pack(1.9)),
    Edge(limits.none_allowed, too_low(1.0), WIDEST, policy=of_pack(1.0)),
    Edge(limits.none_allowed, at_most(0.0), WIDEST, policy=of_pack(0.0)),
    # a charger that chooses its own current is only told to pause
    Edge(limits.none_allowed, None, WIDEST, policy=of_pack(0.5), control=AUTOMATIC),
    Edge(limits.none_allowed, at_most(0.0), WIDEST, policy=of_pack(0.0), control=AUTOMATIC),
)  # fmt: skip


@pytest.mark.parametrize(
    ("station_a", "key", "allowed_a"),
    [
        (14.0, "pack.current_a", 20.0),
        (13.99, "limits.current_a", 11.0),
        (11.0, "limits.current_a", 11.0),
        (10.99, "limits.current_a", 8.0),
    ],
)
def test_the_station_limits_to_its_highest_step(station_a: float, key: str, allowed_a: float) -> None:
    """On the charger's highest step it limits nothing."""
    f = Edge(limits.lowest, None, WIDEST).facts
    rules = Rules.of(bay(of_pack(20.0), current_a=station_a))
    assert limits.lowest(changed(f, rules=rules)) == Bound(allowed_a, key)


@pytest.mark.parametrize(("station_a", "top_step"), [(14.7, 4), (14.69, 3), (2.1, 0)])
def test_the_worst_of_each_step_is_above_it_by_its_tolerance(station_a: float, top_step: int) -> None:
    the_bay = bay(current_a=station_a)
    rules = Rules.of(replace(the_bay, charger=replace(the_bay.charger, tolerance_pct=5.0)))
    assert rules.worst_a == (2.1, 5.25, 8.4, 11.55, 14.7)
    assert rules.top_step == top_step


def test_no_higher_step_than_the_lowest_is_taken_where_none_is_allowed() -> None:
    assert Rules.of(bay(current_a=1.99)).top_step <= 0


def test_every_bound_has_its_key() -> None:
    rules = Rules.of(bay())
    assert rules.pack_bound == Bound(14.0, "pack.current_a")
    assert rules.where_a == (2.0,)
    assert rules.where_bounds == (Bound(2.0, "current.where[0]", POLICY.current.where[0]),)
    assert POLICY.current.temperature_c is not None
    cold, cool, warm = POLICY.current.temperature_c.rows
    assert rules.table_bounds[0] == (
        Bound(2.0, "current.temperature_c.rows[0]", cold),
        Bound(6.0, "current.temperature_c.rows[1]", cool),
        Bound(14.0, "current.temperature_c.rows[2]", warm),
    )


# --- which rows are in force ------------------------------------------------------------------------------------------


def in_force(f: Facts) -> Tables:
    return rows.update(f)


def tables(temperature: int = 2, *where: tuple[str, int], soc: int = 0, returns: Any = ()) -> Tables:
    return Tables((("temperature_c", temperature), ("soc_pct", soc), ("soh_pct", 1), *where), returns)


def known(before: Tables, **more: Any) -> dict[str, Any]:
    return {"rows": before.rows, "row_returns": before.row_returns, **more}


assert POLICY.current.temperature_c is not None
COLD, COOL, WARM = POLICY.current.temperature_c.rows
#: Its first two rows allow the same.
LEVEL_TABLE = replace(POLICY.current.temperature_c, rows=(COLD, replace(COOL, max_a=2.0), WARM))
LEVEL = replace(POLICY, current=replace(POLICY.current, temperature_c=LEVEL_TABLE))
WHERE = ("where[0]", 0)
THRICE = (("current.where[0]", 3),)
GONE: dict[str, Any] = {
    "state": S.IDLE, "bmu_link": {"online": False}, "snapshot": {"battery": BatteryReading()},
    "charger": {"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL, "current_a": 0.0, "voltage_v": 0.0},
}  # fmt: skip
ROWS = (
    Edge(in_force, tables()),
    # a gentler row is left only well inside the next one
    Edge(in_force, tables(0), known(tables(0)), bmu={"temperature_c": 10.9}),
    Edge(in_force, tables(1), known(tables(0)), bmu={"temperature_c": 11.0}),
    Edge(in_force, tables(1), known(tables(0)), bmu={"temperature_c": 10.5}, policy=LEVEL),
    Edge(in_force, tables(0), known(tables(1)), bmu={"temperature_c": 9.9}),
    # a policy that has fewer rows by now
    Edge(in_force, tables(2), known(tables(3))),
    Edge(in_force, tables(0), known(tables(3)), bmu={"temperature_c": 5.0}),
    # a rule on several quantities
    Edge(in_force, tables(1, WHERE), bmu={"temperature_c": 14.0, "soc_pct": 85.0}),
    Edge(in_force, tables(2, WHERE), bmu={"temperature_c": 15.0, "soc_pct": 85.0}),
    Edge(in_force, tables(2), bmu={"temperature_c": 15.1, "soc_pct": 85.0}),
    Edge(in_force, tables(2), bmu={"temperature_c": 16.0, "soc_pct": 85.0}),
    Edge(in_force, tables(2, WHERE), known(tables(2, WHERE)), bmu={"temperature_c": 16.0, "soc_pct": 85.0}),
    Edge(in_force, tables(2), known(tables(2, WHERE)), bmu={"temperature_c": 16.1, "soc_pct": 85.0}),
    # one that came back too often stays for the rest of the charge
    Edge(in_force, tables(2, WHERE, returns=THRICE), known(tables(2, WHERE, returns=THRICE), **OPEN)),
    Edge(in_force, tables(returns=(("current.where[0]", 2),)),
         known(tables(2, WHERE, returns=(("current.where[0]", 2),)), **OPEN)),
    Edge(in_force, tables(returns=THRICE), known(tables(returns=THRICE), **OPEN)),
    Edge(in_force, tables(), known(tables(2, WHERE, returns=THRICE))),
    Edge(in_force, tables(), known(tables(2, returns=THRICE))),
    # another battery
    Edge(in_force, Tables(), known(tables()), **GONE),
    Edge(in_force, Tables(), known(tables(), boots=1), bmu_link={"boots": 2}),
    Edge(in_force, tables(), known(tables(), boots=2), bmu_link={"boots": 2}),
)  # fmt: skip

EDGES = (*ALLOWED, *ROWS)


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: edge.name)
def test_a_limit_at_its_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_rows_that_stay_are_the_same_object() -> None:
    f = Edge(in_force, None, known(tables())).facts
    assert rows.update(f) is f.memory.tables
    gone = Edge(in_force, None, **GONE).facts
    gone = gone.with_memory(changed(gone.memory, tables=Tables((), ())))
    assert rows.update(gone) is gone.memory.tables
