"""The contactor: every state, and the sequences of events in which it closes and opens."""

from dataclasses import dataclass
from itertools import product

import pytest

from orchestrator.core.contactor import closes
from orchestrator.core.next_transition import QUALIFY_S
from orchestrator.core.states import ENERGISED
from orchestrator.model import Action, Alarm, Request, State
from tests.core.bays import charging
from tests.core.said import cause, reason_of
from tests.core.world import TICK_S, World

#: (closed until now, the charger shows standby) → closed; `x` for yes.
TABLE = """
                      open  open+standby  closed  closed+standby
STARTING              .     .             .       .
OFFLINE               .     x             .       x
IDLE                  x     x             x       x
HELD                  x     x             x       x
QUALIFYING            x     x             x       x
PRECHARGE_PULSE       x     x             x       x
PRECHARGE_CONTINUOUS  x     x             x       x
CHARGING              x     x             x       x
FULL                  x     x             x       x
SUSPENDED             x     x             x       x
STOPPING              .     .             x       x
TRIPPED               .     .             .       .
UNCONTROLLABLE        .     .             .       .
"""
ROWS = {State(row.split()[0]): row.split()[1:] for row in TABLE.strip().splitlines()[1:]}


@pytest.mark.parametrize("state", State)
def test_every_state(state: State) -> None:
    cases = product((False, True), (False, True))
    assert ["x" if closes(state, closed=closed, standby=standby) else "." for closed, standby in cases] == ROWS[state]


@dataclass
class Wired:
    """A world with a contactor in front of the battery; the contactor follows the decision within a tick."""

    world: World

    def tick(self, request: Request | None = None) -> State:
        world = self.world
        closed = bool(world.decisions) and world.decision.closed
        world.connected = closed
        world.volts = None if closed and world.battery_answers else 0.0
        return world.tick(request=request).state

    def until(self, state: State, at_most_s: float = 60.0) -> None:
        for _ in range(round(at_most_s / TICK_S)):
            if self.tick() is state:
                return
        raise AssertionError(f"{state} not reached, but {self.world.decision}")

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.tick()

    @property
    def courses(self) -> list[tuple[State, bool]]:
        """State and contactor, each pair once."""
        pairs = [(decision.state, decision.closed) for decision in self.world.decisions]
        return [now for before, now in zip([None, *pairs], pairs, strict=False) if now != before]


def test_it_closes_on_verified_standby_long_before_a_charge() -> None:
    wired = Wired(World())
    wired.until(State.CHARGING)
    assert wired.courses == [
        (State.STARTING, False),
        (State.IDLE, True),
        (State.QUALIFYING, True),
        (State.CHARGING, True),
    ]
    assert not wired.world.raised


def test_a_bay_without_a_battery_comes_to_rest() -> None:
    """At the start the contactor is open: only closing it shows whether a battery is there."""
    world = World()
    world.leave()
    wired = Wired(world)
    wired.run(10)
    assert wired.courses == [(State.STARTING, False), (State.OFFLINE, True), (State.IDLE, True)]
    assert reason_of(world.decision) == "no battery"
    world.arrive()
    wired.until(State.CHARGING)


def test_a_stop_is_waited_for_and_then_the_trip_isolates() -> None:
    wired = Wired(World())
    wired.until(State.CHARGING)
    wired.run(5)
    wired.world.values["temperature_c"] = 70.0
    wired.until(State.TRIPPED)
    assert wired.courses[-3:] == [(State.CHARGING, True), (State.STOPPING, True), (State.TRIPPED, False)]


def test_a_trip_over_unlike_voltages_can_be_reset_behind_the_open_contactor() -> None:
    wired = Wired(World())
    wired.until(State.CHARGING)
    wired.run(5)
    while "volts_disagree" not in wired.world.raised:
        wired.world.volts = 30.0
        wired.world.tick()
    wired.until(State.TRIPPED)
    wired.run(2)
    wired.tick(Request.RESET)
    assert (wired.world.decision.answer, wired.world.decision.closed) == (None, True)
    wired.tick(Request.START)
    wired.until(State.CHARGING)


def test_a_charger_that_does_not_stop_is_cut_off_after_its_time() -> None:
    wired = Wired(World())
    wired.until(State.CHARGING)
    wired.run(5)
    wired.world.deaf.update(Action)
    wired.tick(Request.STOP)
    since_s = wired.world.now_s
    assert wired.world.decision.closed
    while wired.world.decision.closed:
        wired.tick()
    assert (wired.world.state, wired.world.now_s - since_s) == (State.UNCONTROLLABLE, 3.0)
    assert wired.world.decision.alarm is Alarm.DANGER


def test_a_charger_that_falls_silent_in_a_charge_is_cut_off() -> None:
    wired = Wired(World())
    wired.until(State.CHARGING)
    wired.run(5)
    wired.world.charger_answers = False
    wired.until(State.UNCONTROLLABLE)
    wired.run(5)
    assert not wired.world.decision.closed


def test_a_battery_that_leaves_in_a_charge_is_seen_to_leave() -> None:
    wired = Wired(World())
    wired.until(State.CHARGING)
    wired.run(5)
    wired.world.leave()
    wired.run(20)
    assert (reason_of(wired.world.decision), wired.world.raised) == ("no battery", {})
    assert all(closed for state, closed in wired.courses if state is not State.STARTING)


def test_a_battery_whose_bmu_falls_silent_does_not_look_like_one_that_left() -> None:
    wired = Wired(World())
    wired.until(State.CHARGING)
    wired.run(5)
    wired.world.battery_answers, wired.world.volts = False, None
    while wired.world.state is not State.OFFLINE:
        wired.world.tick()
    wired.world.tick()
    assert wired.world.decision.closed
    assert "bmu_silent" in wired.world.raised


def test_what_was_measured_behind_an_open_contactor_qualifies_nothing() -> None:
    """The charger's volts must be those of the battery, which shows only while the contactor is closed."""
    world = World()
    world.connected = False
    for _ in range(round(20 / TICK_S)):
        world.tick()
    assert (world.state, world.decision.closed) == (State.QUALIFYING, True)
    assert "waiting for the contactor" in reason_of(world.decision)
    world.connected = True
    closed_s = world.now_s
    while world.state is State.QUALIFYING:
        world.tick()
    assert world.state is State.CHARGING
    assert world.now_s - closed_s >= QUALIFY_S


@pytest.mark.parametrize("state", sorted(ENERGISED))
def test_without_its_output_nothing_charges(state: State) -> None:
    world = charging() if state is State.CHARGING else World(voltage_v=36.0).charging(state)
    world.connected, world.contactor_problem = False, cause("/dev/gpiochip0 line 17: gone")
    world.tick()
    assert (world.state, set(world.raised)) == (State.STOPPING, {"contactor_lost"})
