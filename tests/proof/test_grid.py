"""The grid in its short form: every state × every row, the line's three conditions in turn."""

import pytest

from orchestrator.core.faults import FAULTS
from orchestrator.devices.schedule import Due, Schedule, Turn
from orchestrator.interlock import ALLOWED
from orchestrator.model import Action, ControlMode, State
from tests.proof.grid import Cell, Phase, Used, cells, orders, play

PHASES = tuple(Phase)
#: The charger takes this order, and no policy has a use for it: a charge ends by a stop.
NEVER_ORDERED = {(Action.SET_MODE, 5)}


@pytest.fixture(name="used", scope="module")
def _used() -> Used:
    return Used()


@pytest.mark.parametrize("state", State)
def test_every_fault_ends_well(state: State, used: Used) -> None:
    for number, cell in enumerate(cells(lambda number: (PHASES[number % 3],))):
        if cell.state is state:
            wrong = play(cell, used)
            assert not wrong, f"{number}: {cell}: {wrong}"


def test_every_row_of_the_fault_table_was_raised(used: Used) -> None:
    assert {row.id for row in FAULTS} - used.rows == set()


def test_every_order_that_the_interlock_allows_is_used() -> None:
    let_out = orders(15.0, None)
    for limit_a in (2.0, 5.0, 8.0, 11.0, 14.0):
        let_out |= orders(limit_a, 50.0)
    allowed = {
        (action, value) for action, values in ALLOWED[ControlMode.MANUAL].items() for value in values
    }  # fmt: skip
    assert let_out - {(Action.STOP, 0)} == allowed - NEVER_ORDERED


def test_a_stop_that_waits_for_its_slot_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    of_schedule = Schedule.next

    def waits(schedule: Schedule) -> Due:
        due = of_schedule(schedule)
        return Due(Turn.STOP, schedule._slot_s) if due.turn is Turn.STOP else due

    monkeypatch.setattr(Schedule, "next", waits)
    hot = next(row for row in FAULTS if row.id == "hot_trip")
    wrong = play(Cell(State.CHARGING, hot, Phase.IDLE), Used())
    assert any("the stop was written" in line for line in wrong)
