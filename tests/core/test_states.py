"""Every state has its row, and every kind of state is used somewhere."""

import re
from pathlib import Path

import pytest

import orchestrator
from orchestrator.core import states
from orchestrator.core.states import TABLE, Kind, ordered
from orchestrator.model import State

SOURCES = [path.read_text(encoding="utf-8") for path in Path(orchestrator.__file__).parent.rglob("*.py")]
HAND_KEPT = re.compile(r"frozenset\(\s*\{\s*State\.\w+\s*,")


def test_every_state_has_a_row() -> None:
    assert set(TABLE) == set(State)


@pytest.mark.parametrize("kind", Kind)
def test_a_class_is_what_the_table_says_and_is_used(kind: Kind) -> None:
    assert getattr(states, kind.name) == states._of(kind) == {state for state in State if kind in TABLE[state]}
    assert sum(re.search(rf"\b{kind.name}\b", source) is not None for source in SOURCES) > 1, "nobody uses it"


def test_no_two_classes_are_the_same() -> None:
    sets = [getattr(states, kind.name) for kind in Kind]
    assert len(sets) == len(set(sets))


def test_nobody_keeps_a_set_of_several_states_of_his_own() -> None:
    assert not [source[:60] for source in SOURCES if HAND_KEPT.search(source)]


def test_the_order_is_that_of_a_charge() -> None:
    assert ordered(states.PRECHARGING) == (State.PRECHARGE_PULSE, State.PRECHARGE_CONTINUOUS)
