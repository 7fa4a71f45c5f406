"""How a charger is brought to a setpoint: resume → limit → mode → precharge function → run, each read back first."""

from collections.abc import Callable
from itertools import product

import pytest

from orchestrator.core.facts import Facts
from orchestrator.core.sequence import next_command
from orchestrator.core.states import ENERGISED
from orchestrator.devices.schedule import Turn
from orchestrator.model import (
    STANDBY,
    STOP,
    Action,
    ChargeMode,
    Command,
    ControlMode,
    Operation,
    Precharge,
    Request,
    Setpoint,
    Snapshot,
    State,
)
from orchestrator.sim.pack import Pack
from tests.core.bays import charging, pulse
from tests.core.fault_scenes import SCENES, Scene
from tests.core.said import reason_of
from tests.core.site import Site
from tests.core.world import World, bay

RESUME, RUN = Command(Action.RESUME), Command(Action.RUN)


def limit(index: int) -> Command:
    return Command(Action.SET_LIMIT, index)


def mode(value: ChargeMode) -> Command:
    return Command(Action.SET_MODE, value)


def precharge(value: Precharge) -> Command:
    return Command(Action.SET_PRECHARGE, value)


CHARGE = mode(ChargeMode.CHARGE)


def orders_since(world: World, first: int) -> list[Command | None]:
    commands = [decision.command for decision in world.decisions[first:]]
    return [now for before, now in zip([STOP, *commands], commands, strict=False) if now != before]


def new_charge(voltage_v: float = 48.0) -> tuple[World, int]:
    """A world at the decision that energises, and that decision's number."""
    world = World(voltage_v=voltage_v)
    world.until(State.QUALIFYING)
    while world.state not in ENERGISED:
        world.tick()
    return world, len(world.decisions) - 1


# --- in order, one after another --------------------------------------------------------------------------------------


def test_a_charge_begins_in_order() -> None:
    world, first = new_charge()
    world.charger.precharge = Precharge.PULSE  # left from before
    world.run(5)
    assert orders_since(world, first) == [RESUME, limit(4), CHARGE, precharge(Precharge.OFF), RUN, None]
    assert world.charger.running


def test_what_is_there_already_is_not_ordered() -> None:
    world, first = new_charge()
    world.charger.limit = 4
    world.run(5)
    assert orders_since(world, first) == [RESUME, CHARGE, RUN, None]


def test_precharge_begins_in_order() -> None:
    world, first = new_charge(voltage_v=33.0)
    world.charger.limit = 3
    world.run(5)
    in_order = [RESUME, limit(0), mode(ChargeMode.PRECHARGE), precharge(Precharge.PULSE), RUN, None]
    assert orders_since(world, first) == in_order


def test_from_stage_to_stage_only_what_differs_is_ordered() -> None:
    world = pulse()
    first = len(world.decisions)
    world.values["voltage_v"] = 35.1
    world.until(State.PRECHARGE_CONTINUOUS)
    world.run(5)
    world.values["voltage_v"] = 39.0
    world.until(State.CHARGING)
    world.run(5)
    assert orders_since(world, first) == [
        None,
        precharge(Precharge.CONTINUOUS),
        None,
        limit(4),
        CHARGE,
        precharge(Precharge.OFF),
        None,
    ]


def test_a_new_step_is_one_order() -> None:
    world = charging()
    first = len(world.decisions)
    world.values["soc_pct"] = 90.0
    world.run(5)
    assert orders_since(world, first) == [limit(2), None]
    assert world.charger.limit == 2


STAGES: tuple[tuple[Action, Callable[[World], object]], ...] = (
    (Action.SET_LIMIT, lambda world: world.charger.limit == 0),
    (Action.SET_MODE, lambda world: world.charger.mode is not ChargeMode.CHARGE),
    (Action.SET_PRECHARGE, lambda world: world.charger.precharge is Precharge.PULSE),
    (Action.RUN, lambda world: not world.charger.running),
)


@pytest.mark.parametrize(("lost", "still"), STAGES, ids=[action.value for action, _ in STAGES])
def test_nothing_goes_on_before_the_read_back(lost: Action, still: Callable[[World], object]) -> None:
    world, first = new_charge()
    world.charger.precharge = Precharge.PULSE
    world.deaf.add(lost)
    world.run(4)
    commands = [command for command in orders_since(world, first) if command not in (RESUME, None)]
    assert commands[-1].action is lost
    assert still(world)
    world.deaf.clear()
    world.run(2)
    assert world.charger.running
    assert world.is_in(State.CHARGING)
    assert not world.raised


def test_the_order_stands_until_its_read_back() -> None:
    """A lost frame costs one slot and nothing else."""
    world, _ = new_charge()
    world.tick()
    world.deaf.add(Action.SET_LIMIT)
    for _ in range(4):
        assert world.tick().command == limit(4)
    world.deaf.clear()
    assert world.tick().command == CHARGE


# --- the resume, which has no read-back of its own --------------------------------------------------------------------


def test_a_resume_counts_when_a_reply_was_asked_for_after_it() -> None:
    world, _ = new_charge()
    world.port_hangs = True
    for _ in range(3):
        assert world.tick(dt_s=0.1).command == RESUME  # sent, but the newest reading is older
    world.port_hangs = False
    assert world.tick().command == limit(4)


def test_a_resume_that_was_sent_for_the_last_charge_counts_for_nothing() -> None:
    world = charging()
    world.ask(Request.PAUSE)
    world.until(State.SUSPENDED)
    world.ask(Request.START)
    first = len(world.decisions)
    world.until(State.CHARGING)
    world.run(3)
    assert RESUME in orders_since(world, first)
    assert world.charger.running


def test_a_lost_resume_is_sent_again() -> None:
    """Without it the charger stays in standby, whatever its settings."""
    world, first = new_charge()
    world.deaf.add(Action.RESUME)
    world.run(1.75)
    assert world.decision.command == CHARGE
    world.deaf.clear()
    world.run(3)
    assert orders_since(world, first) == [RESUME, limit(4), CHARGE, RESUME, RUN, None]
    assert world.charger.running


def test_after_a_stop_everything_begins_with_a_resume() -> None:
    world = charging()
    world.ask(Request.PAUSE)
    world.until(State.SUSPENDED)
    world.ask(Request.START)
    world.until(State.CHARGING)
    assert world.decision.command == RESUME


# --- while it runs ----------------------------------------------------------------------------------------------------


def test_a_charger_on_its_way_is_left_alone() -> None:
    for shown in (ChargeMode.BATTERY_SEARCH, ChargeMode.BATTERY_RECOVERY):
        world = charging()
        world.shows["charge_mode"] = shown
        world.run(10)
        assert world.decision.command is None
        assert world.is_in(State.CHARGING)


def test_a_setting_that_changes_by_itself_is_set_back() -> None:
    world = charging()
    world.charger.limit = 0
    assert world.tick().command == limit(4)
    world.tick()
    assert world.charger.limit == 4


def test_a_charger_that_was_stopped_by_somebody_is_not_started_again() -> None:
    world = charging()
    first = len(world.decisions)
    world.charger.run = False
    world.run(3)
    assert orders_since(world, first) == [None, STOP, None]
    assert world.is_in(State.HELD)


def test_without_a_reading_the_order_stays() -> None:
    """The fault table ends the charge in the same decision; meanwhile there is no new command."""
    world, _ = new_charge()
    memory = world.memory
    facts = Facts.of(world.now_s + 10, Snapshot(), memory, world.rules)
    assert next_command(facts, Setpoint(run=True))[0] == memory.sequence.command == limit(4)


def test_what_a_setpoint_leaves_open_is_not_ordered() -> None:
    world = charging()
    facts = Facts.of(world.now_s, world.snapshot(None, ""), world.memory, world.rules)
    assert next_command(facts, STANDBY)[0] is None


# --- automatic: the rotary switch has set everything ------------------------------------------------------------------


def automatic(**battery: float) -> World:
    return World(bay(control=ControlMode.AUTOMATIC), **battery)


def test_automatic_mode_needs_a_resume_and_nothing_else() -> None:
    world = automatic()
    world.until(State.CHARGING)
    world.run(10)
    assert world.commands == [STOP, None, STOP, None, RESUME, None]
    assert world.charger.running
    assert world.decision.setpoint == Setpoint(run=True)
    assert world.decision.step is None
    assert reason_of(world.decision) == "the charger charges by itself (automatic mode)"


def test_automatic_mode_leaves_precharge_to_the_charger() -> None:
    world = automatic(voltage_v=33.0)
    world.until(State.CHARGING)
    world.run(10)
    assert State.PRECHARGE_PULSE not in world.states()


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_automatic_mode_never_hears_anything_but_stop_and_resume(scene: Scene) -> None:
    world = automatic()
    world.until(State.CHARGING)
    world.run(2)
    for change in (scene.spoil, scene.heal):
        change(world)
        world.run(25)
        for request in (Request.STOP, Request.RESET, Request.START, Request.PAUSE, Request.START):
            world.ask(request)
            world.run(1)
    assert {decision.command for decision in world.decisions} <= {None, STOP, RESUME}


# --- on a line that loses frames --------------------------------------------------------------------------------------


class Lossy(Site):
    """Loses the first frames of one kind."""

    def __init__(self, turn: Turn, count: int, at: int) -> None:
        pack = Pack()
        pack.set_soc(50)
        super().__init__(pack)
        self.turn, self.count, self.at, self.frames = turn, count, at, 0
        self.ran_unasked = False

    def _hear(self, turn: Turn, command: Command) -> None:
        if turn is self.turn:
            self.frames += 1
            if self.at < self.frames <= self.at + self.count:
                return
        super()._hear(turn, command)

    def tick(self, request: Request | None = None) -> None:
        super().tick(request)
        wanted = self.decision.state in ENERGISED
        before_run = self.memory.sequence.command is not None
        self.ran_unasked |= self.charger.running and wanted and before_run and self.memory.sequence.command != RUN


@pytest.mark.parametrize(("count", "at"), list(product((1, 2, 3), (0, 1, 2, 3, 4, 5, 6))))
def test_any_order_may_be_lost(count: int, at: int) -> None:
    site = Lossy(Turn.ORDER, count, at)
    site.until(State.CHARGING, 10)
    site.run(8)
    assert site.charger.running
    assert site.charger.current_step == 4
    assert site.raised == {}


def test_a_lost_half_of_a_stop_lets_no_charger_run_on_its_old_values() -> None:
    """Standby hides whether operation 0 was received; a resume would show it, too late."""
    site = Lossy(Turn.OPERATION_STOP, count=0, at=0)
    site.until(State.CHARGING, 10)
    site.run(10)
    site.count, site.at = 99, site.frames
    site.run(0.5, Request.PAUSE)
    site.until(State.SUSPENDED, 1.5)
    site.count = 0
    assert site.charger.run, "the second frame was to be lost"
    site.pack.set_soc(92)  # on its way to step 2
    site.run(1)
    assert site.run(8, Request.START).state is State.CHARGING
    assert site.charger.current_step == 2
    assert not site.ran_unasked


def test_a_run_is_ordered_only_when_everything_else_is_read_back() -> None:
    for volts in (33.0, 36.0, 48.0):
        world, _ = new_charge(voltage_v=volts)
        while not world.charger.running:
            decision = world.tick()
            if decision.command == RUN:
                shown, wanted = world.reading, decision.setpoint
                assert shown is not None
                assert (shown.current_step, shown.charge_mode, shown.precharge) == (
                    wanted.current_step,
                    wanted.charge_mode,
                    wanted.precharge,
                )
                assert shown.operation is Operation.STOPPED
