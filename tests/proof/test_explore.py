"""Everything that the core can come to, with the quick set of inputs: no property is broken, no row is idle."""

from collections.abc import Iterator

import pytest

from orchestrator.model import ControlMode, State
from orchestrator.workbench.endings import reaches, settles
from orchestrator.workbench.exhaustive import here
from orchestrator.workbench.explore import Explorer, outline
from tests.proof.exploring import NEVER, changes_of_table, quick, rules, walk_on


@pytest.fixture(name="explored", scope="module", params=list(ControlMode), ids=lambda mode: mode.name.lower())
def _explored(request: pytest.FixtureRequest) -> Iterator[Explorer]:
    walk = walk_on(quick(rules(control=request.param)))
    explorer = Explorer(walk, here(walk))
    explorer.run()
    reaches(explorer)
    settles(explorer, {outline(node.place.memory): node for node in explorer.nodes}.values())
    yield explorer


def test_every_property_holds(explored: Explorer) -> None:
    assert not explored.found, "\n".join(map(str, explored.found.values()))


def test_every_state_is_reached(explored: Explorer) -> None:
    precharge = {State.PRECHARGE_PULSE, State.PRECHARGE_CONTINUOUS} if not explored.walk.rules.manual else set()
    assert {node.place.memory.state for node in explored.nodes} == set(State) - precharge


def test_every_change_of_the_table_is_made_and_no_other(explored: Explorer) -> None:
    if not explored.walk.rules.manual:
        assert explored.changes < changes_of_table()
        return
    assert changes_of_table() - explored.changes == set(NEVER)
    assert explored.changes - changes_of_table() == set()
