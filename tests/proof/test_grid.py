"""The short form of the grid: every row in mid-charge and in a third of the other states."""

from collections.abc import Iterator

import pytest

from orchestrator.core.faults import FAULTS
from orchestrator.devices.schedule import Due, Schedule, Turn
from orchestrator.model import State
from tests.proof.exploring import changes_of_table
from tests.proof.grid import Cell, Phase, Used, play
from tests.proof.paths import NEVER_MADE, PATHS
from tests.proof.play import play as play_script
from tests.proof.whole_grid import NEVER_ORDERED, orders_allowed, orders_let_out

STATES, PHASES = tuple(State), tuple(Phase)
#: Every Nth state of a row, and all of a row that is looked for in so few; `make campaign` plays the whole grid.
NTH, FEW = 3, 3


def sample(state: State) -> Iterator[Cell]:
    """In mid-charge every row; in each other state another third. A row meets each activity of the line somewhere."""
    at = STATES.index(state)
    for number, row in enumerate(FAULTS):
        if state is State.CHARGING:
            yield Cell(state, row, PHASES[number % len(PHASES)])
        elif (number + at) % NTH == 0 or (state in row.where and len(row.where) <= FEW):
            yield Cell(state, row, PHASES[at // NTH % len(PHASES)])


@pytest.fixture(name="used", scope="module")
def _used() -> Used:
    return Used()


@pytest.mark.parametrize("state", State)
def test_every_fault_ends_well(state: State, used: Used) -> None:
    for cell in sample(state):
        wrong = play(cell, used).wrong
        assert not wrong, f"{cell}: {wrong}"


def test_every_row_of_the_fault_table_was_raised(used: Used) -> None:
    assert {row.id for row in FAULTS} - used.rows == set()


def test_every_change_of_the_table_was_made(used: Used) -> None:
    for script in PATHS.values():
        played = play_script(script)
        assert not played.violations
        used.changes |= played.changes
    assert changes_of_table() - used.changes == set(NEVER_MADE)
    assert used.changes <= changes_of_table()


def test_every_order_that_the_interlock_allows_is_used() -> None:
    assert orders_allowed() - orders_let_out() == set(NEVER_ORDERED)
    assert orders_let_out() <= orders_allowed()


def test_a_stop_that_waits_for_its_slot_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    of_schedule = Schedule.next

    def waits(schedule: Schedule) -> Due:
        due = of_schedule(schedule)
        return Due(Turn.STOP, schedule._slot_s) if due.turn is Turn.STOP else due

    monkeypatch.setattr(Schedule, "next", waits)
    hot = next(row for row in FAULTS if row.id == "hot_trip")
    wrong = play(Cell(State.CHARGING, hot, Phase.IDLE), Used()).wrong
    assert any("the stop was written" in line for line in wrong)
