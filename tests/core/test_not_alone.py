"""A bay among others: it waits for its turn and for the disk, and current it did not order is stopped."""

import pytest

from orchestrator.core import faults, latches
from orchestrator.model import STOP, Action, Cause, State
from tests.core.bays import IN, idle
from tests.core.said import reason_of
from tests.core.world import World

S = State


def test_a_bay_that_is_ready_waits_for_its_turn_and_says_for_whom() -> None:
    """Packs on one station begin one after the other; until then only the stop is commanded."""
    world = World()
    turn = world.ours["waits"] = Cause.of("waits_for_turn", other="bay-2")
    world.until(S.QUALIFYING)
    world.run(30)
    assert world.is_in(S.QUALIFYING)
    assert world.decision.cause == turn
    assert {command.action for command in world.commands if command is not None} == {Action.STOP}
    world.ours["waits"] = None
    world.charging()


def test_nothing_runs_before_it_is_on_disk_that_it_may() -> None:
    world = World()
    world.ours["running_persisted"] = False
    world.until(S.QUALIFYING)
    world.run(30)
    assert world.is_in(S.QUALIFYING)
    assert world.decision.cause == Cause("writing_down")
    assert {command.action for command in world.commands if command is not None} == {Action.STOP}
    world.ours["running_persisted"] = True
    world.charging()


@pytest.mark.parametrize("state", [S.IDLE, S.HELD, S.FULL, S.SUSPENDED])
def test_current_that_nobody_ordered_is_stopped_even_without_a_fault_for_it(
    state: State, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The table has two rows for that. Even without both, the bay does not continue as if in standby."""
    others = tuple(row for row in faults.FAULTS if row.id not in ("rogue_run", "current_without_order"))
    monkeypatch.setattr(latches, "FAULTS", others)
    world = IN[state]()
    world.pack_amps = 5.0
    world.until(S.STOPPING, 5)
    assert world.decision.command == STOP
    assert "the BMU sees 5.00 A flow into the pack" in reason_of(world.decision)


def test_a_glimpse_of_current_stops_nothing() -> None:
    """A BMU averages: it may briefly go on showing an earlier current."""
    world = idle()
    world.pack_amps = 5.0
    world.run(1.5)
    world.pack_amps = None
    world.run(10)
    assert S.STOPPING not in world.states(10)
