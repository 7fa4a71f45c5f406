"""The memory's parts: frozen, each made by one module, each field with its kind."""

import ast
import pickle
from collections import Counter
from collections.abc import Iterator
from dataclasses import FrozenInstanceError, dataclass, fields, replace
from pathlib import Path
from typing import Any

import pytest

import orchestrator.core
from orchestrator.core.decide import decide
from orchestrator.core.facts import Facts
from orchestrator.core.memory import (
    FLAT,
    PARTS,
    RECORDS,
    BatteryHistory,
    FaultMemory,
    Memory,
    Stage,
    by_policy,
    in_parts,
    names,
    paths,
    side_by_side,
    telling,
    value_of,
    with_values,
)
from orchestrator.core.parts import Kind, changed, event, made, measured, total, unclassed
from orchestrator.model import Session, Snapshot, State
from tests.core.bays import IN
from tests.core.world import World

CORE = Path(orchestrator.core.__file__).parent
#: The module that makes the next one of each part. A restart starts from the persisted state, by the same names.
MADE_BY: dict[str, set[str]] = {
    "Operator": {"operator", "persisted"},
    "Stop": {"safestop"},
    "Stage": {"history/stage"},
    "Sequence": {"sequence"},
    "ChargerHistory": {"history/charger"},
    "BatteryHistory": {"history/battery", "history/same_battery"},
    "Tables": {"rows"},
    "Witnessed": {"witnesses/followed"},
    "Session": {"history/session", "persisted"},
    "FaultMemory": {"latches", "failed", "persisted"},
    "Memory": {"decide", "failed", "history/__init__", "persisted"},
}
CLASSES: dict[str, type[Any]] = {
    **{kind.__name__: kind for kind in PARTS.values()}, "Session": Session, "FaultMemory": FaultMemory, "Memory": Memory
}  # fmt: skip
#: The modules that define the parts with their defaults, and change records of any kind.
APART = ("memory", "parts")


def calls(source: str) -> Iterator[tuple[str, list[str]]]:
    """Each call, with its keywords."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            called = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
            yield called, [keyword.arg for keyword in node.keywords if keyword.arg]


def makes(source: str) -> set[str]:
    """The classes that this source makes records of: by name, or by changing a field that only they have."""
    found = set()
    for called, keywords in calls(source):
        if called in MADE_BY:
            found.add(called)
        if called in ("changed", "replace"):
            for keyword in keywords:
                owners = {name for name, kind in CLASSES.items() if keyword in {one.name for one in fields(kind)}}
                found |= owners if len(owners) == 1 else set()
    return found


def test_each_part_has_a_maker() -> None:
    assert {kind.__name__ for kind in PARTS.values()} - {"Cause"} <= MADE_BY.keys()


@pytest.mark.parametrize("path", sorted(CORE.rglob("*.py")), ids=lambda path: str(path.relative_to(CORE)))
def test_a_part_is_made_by_its_module_alone(path: Path) -> None:
    module = str(path.relative_to(CORE).with_suffix(""))
    if module not in APART:
        made_here = makes(path.read_text(encoding="utf-8"))
        assert {name for name in made_here if module not in MADE_BY[name]} == set()


def test_a_part_that_another_module_makes_is_seen() -> None:
    assert makes("changed(f.memory.operator, hold=None)") == {"Operator"}
    assert makes("Stage(ran=True)") == {"Stage"}


# --- the fields -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name in PARTS if name != "cause"])
def test_each_field_says_what_it_is(name: str) -> None:
    assert [one.name for one in unclassed(PARTS[name])] == []


def test_the_memory_itself_has_parts_and_fields_that_say_what_they_are() -> None:
    assert {one.name for one in unclassed(Memory)} == {*FLAT, "witnessed", "faults", "session"}


@pytest.mark.parametrize("record", [FaultMemory, Session])
def test_each_field_of_a_record_is_classed_once(record: type[Any]) -> None:
    told = [name for kind in RECORDS[record].values() for name in kind]
    assert Counter(told) == Counter(one.name for one in fields(record))


def test_no_two_parts_have_a_field_of_the_same_name() -> None:
    assert max(Counter(names()).values()) == 1


@pytest.mark.parametrize(
    ("state", "told"),
    [
        (State.STOPPING, {"operator.target_pct", "battery.full_pct"}),
        (State.HELD, {"witnessed.sees", "operator.target_pct", "stop.unverified", "battery.full_pct"}),
        (
            State.CHARGING,
            {"witnessed.proved", "operator.target_pct", "stage.ran", "sequence.command", "battery.full_pct"},
        ),
    ],
)
def test_what_tells_two_memories_in_a_state_apart(state: State, told: set[str]) -> None:
    assert set(telling(state)) == told


def test_what_the_policy_alone_keeps() -> None:
    kept = {"faults", "step", "raise_s", "taper_s", "reached_s", "rows", "row_returns"}
    assert set(by_policy()) == kept


def test_every_value_has_one_kind() -> None:
    told = [path.rpartition(".")[2] for kind in Kind for path in paths(kind)]
    inside = [one.name for one in fields(PARTS["witnessed"])]
    assert sorted(told) == sorted({*names(), *inside} - {"witnessed", "faults", "session"})


# --- frozen -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("declared", "kind"), [(event, Kind.EVENT), (total, Kind.TOTAL), (measured, Kind.MEASURED)])
def test_a_field_declares_its_kind(declared: Any, kind: Kind) -> None:
    assert declared(3.0).default == 3.0
    assert declared(3.0).metadata == {"kind": kind, "by_policy": False, "tells": frozenset()}
    if kind is not Kind.TOTAL:
        more = {"by_policy": True, "tells": frozenset({State.IDLE})}
        assert declared(3.0, **more).metadata == {"kind": kind, **more}


def test_a_record_of_a_new_class_is_made_and_changed() -> None:
    @dataclass(frozen=True, slots=True)
    class Pair:
        one: int
        other: str = ""

    pair = made(Pair, 1, "x")
    assert (pair, type(pair)) == (Pair(1, "x"), Pair)
    assert changed(pair, one=2) == Pair(2, "x") != pair

    @dataclass(frozen=True, slots=True)
    class Other(Pair):
        pass

    assert changed(Other(1), one=2) == Other(2)  # a class whose first record is made by a change


def test_nothing_can_be_changed() -> None:
    world = IN[State.CHARGING]()
    facts = Facts.of(world.now_s, Snapshot(), world.memory, world.rules)
    for record, name in ((world.memory, "state"), (world.memory.stage, "ran"), (facts, "memory"), (facts, "soc")):
        with pytest.raises(FrozenInstanceError):
            setattr(record, name, None)


def test_a_changed_record_is_as_if_made_anew() -> None:
    before = Stage(ran=True, raise_s=1.0)
    after = changed(before, ran=False, step=None)
    assert after == replace(before, ran=False, step=None)
    assert (type(after), hash(after), repr(after)) == (Stage, hash(Stage(raise_s=1.0)), repr(Stage(raise_s=1.0)))
    assert pickle.loads(pickle.dumps(after)) == after
    assert before.ran
    with pytest.raises(FrozenInstanceError):
        after.ran = True  # type: ignore[misc]  # that is what is asked


def test_a_field_that_is_not_there_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        changed(Stage(), running=True)  # type: ignore[call-arg]
    with pytest.raises(TypeError):
        made(Stage, True)


def test_a_default_is_what_the_part_begins_with() -> None:
    assert (Stage().ran, BatteryHistory().charge) == (False, (0.0, None))
    assert event(3) != 3  # a field of a dataclass


@pytest.mark.parametrize("state", [State.IDLE, State.HELD, State.OFFLINE, State.CHARGING])
def test_what_has_not_changed_is_the_same_object(state: State) -> None:
    world = IN[state]()
    world.run(5)
    snapshot = world.snapshot(None, "")
    _, before = decide(world.now_s, snapshot, world.memory, world.rules)
    _, after = decide(world.now_s, snapshot, before, world.rules)
    for part in FLAT:
        assert getattr(after, part) is getattr(before, part), part
    assert after.witnessed is before.witnessed


# --- side by side -----------------------------------------------------------------------------------------------------


def test_values_side_by_side_and_in_their_parts() -> None:
    world: World = IN[State.CHARGING]()
    values = side_by_side(world.memory)
    assert set(values) == set(names())
    assert in_parts(values)["stage"]["ran"] is values["ran"] is True
    other = with_values(world.memory, ran=False, hold=None, state=State.IDLE)
    assert (other.state, other.stage, other.charger) == (
        State.IDLE, replace(world.memory.stage, ran=False), world.memory.charger,
    )  # fmt: skip
    assert [value_of(other, name) for name in ("ran", "state")] == [False, State.IDLE]
