"""Everything the core can reach, with one input of each kind: no property is broken, no row is unused."""

from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass

import pytest

from orchestrator.model import ControlMode, State
from orchestrator.workbench.processes import cores
from orchestrator.workbench.prove.exhaustive import here
from orchestrator.workbench.prove.explore import Explorer
from orchestrator.workbench.prove.gist import outline
from orchestrator.workbench.prove.lasting import reaches, settles
from tests.proof.exploring import NEVER, changes_of_table, rules, small, walk_on


@dataclass(frozen=True)
class Explored:
    """The result, from a separate process."""

    control: ControlMode
    found: tuple[str, ...]
    states: frozenset[State]
    changes: frozenset[tuple[State, State]]


def explore(control: ControlMode) -> Explored:
    walk = walk_on(small(rules(control=control)))
    explorer = Explorer(walk, here(walk))
    explorer.run()
    reaches(explorer)
    settles(explorer, {outline(node.place.memory): node for node in explorer.nodes}.values())
    return Explored(
        control,
        tuple(map(str, explorer.found.values())),
        frozenset(node.place.memory.state for node in explorer.nodes),
        frozenset(explorer.changes),
    )


@pytest.fixture(name="explorations", scope="module")
def _explorations() -> Iterator[Mapping[ControlMode, Future[Explored]]]:
    """One for each mode of control, side by side: each takes most of a minute."""
    with cores(len(ControlMode)) as pool:
        yield {control: pool.submit(explore, control) for control in ControlMode}


@pytest.fixture(name="explored", params=list(ControlMode), ids=lambda mode: mode.name.lower())
def _explored(request: pytest.FixtureRequest, explorations: Mapping[ControlMode, Future[Explored]]) -> Explored:
    return explorations[request.param].result()


pytestmark = pytest.mark.timeout(600)  # both explorations may share a processor core


def test_every_property_holds(explored: Explored) -> None:
    assert not explored.found, "\n".join(explored.found)


def test_every_state_is_reached(explored: Explored) -> None:
    precharge = (
        {State.PRECHARGE_PULSE, State.PRECHARGE_CONTINUOUS} if explored.control is ControlMode.AUTOMATIC else set()
    )
    assert explored.states == set(State) - precharge


def test_every_change_of_the_table_is_made_and_no_other(explored: Explored) -> None:
    if explored.control is ControlMode.AUTOMATIC:
        assert explored.changes < changes_of_table()
        return
    assert changes_of_table() - explored.changes == set(NEVER)
    assert explored.changes - changes_of_table() == set()
