"""The short form of the grid: every state × every row, with the line's three activities in turn."""

import pytest

from orchestrator.core.faults import FAULTS
from orchestrator.devices.schedule import Due, Schedule, Turn
from orchestrator.model import State
from tests.proof.exploring import changes_of_table
from tests.proof.grid import Cell, Phase, Used, cells, play
from tests.proof.paths import NEVER_MADE, PATHS
from tests.proof.play import play as play_script
from tests.proof.whole_grid import NEVER_ORDERED, orders_allowed, orders_let_out

PHASES = tuple(Phase)


@pytest.fixture(name="used", scope="module")
def _used() -> Used:
    return Used()


@pytest.mark.parametrize("state", State)
def test_every_fault_ends_well(state: State, used: Used) -> None:
    for number, cell in enumerate(cells(lambda number: (PHASES[number % 3],))):
        if cell.state is state:
            wrong = play(cell, used).wrong
            assert not wrong, f"{number}: {cell}: {wrong}"


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
