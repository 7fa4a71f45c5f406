"""The safe stop: what proves it, what does not, and where every state ends when the charger is silent or deaf."""

import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from orchestrator.core.states import ENERGISED
from orchestrator.model import STOP, Action, Alarm, Operation, Request, State
from tests.core.bays import IN, charging, full, idle, qualifying, running_at_the_start, starting, stopping, suspended
from tests.core.said import cause, reason_of
from tests.core.world import TICK_S, World

#: Where a bay may rest with a verified charger.
VERIFIED = {State.IDLE, State.HELD, State.FULL, State.SUSPENDED, State.TRIPPED, State.OFFLINE}
every_state = pytest.mark.parametrize("state", State)

# --- every state, the worst that a charger can do ---------------------------------------------------------------------


@every_state
def test_a_silent_charger_is_stopped_blindly_until_it_answers(state: State) -> None:
    world = IN[state]()
    world.charger_answers = False
    world.run(60)
    flowing = state in ENERGISED | {State.STOPPING, State.UNCONTROLLABLE}
    resting = State.TRIPPED if state is State.TRIPPED else State.OFFLINE
    assert world.is_in(State.UNCONTROLLABLE if flowing else resting)
    assert (world.decision.alarm is Alarm.DANGER) is flowing
    before = len(world.decisions)
    world.run(60)
    assert all(decision.command == STOP for decision in world.decisions[before:])
    world.charger_answers = True
    world.deaf.clear()
    if flowing:  # ten seconds of standby prove it
        world.run(9.75)
        assert world.is_in(State.UNCONTROLLABLE)
    world.run(1.25)
    assert world.is_in(*VERIFIED, State.QUALIFYING)
    assert not world.charger.running
    assert world.decision.alarm is not Alarm.DANGER


@every_state
def test_a_deaf_charger_that_runs_is_uncontrollable_until_it_stops(state: State) -> None:
    world = IN[state]()
    world.deaf.add(Action.STOP)
    world.charger.resting, world.charger.run = False, True
    if state in ENERGISED:
        world.ask(Request.STOP)
    world.run(10)
    assert world.is_in(State.UNCONTROLLABLE)
    before = len(world.decisions)
    world.run(600, dt_s=0.5)
    assert all(decision.state is State.UNCONTROLLABLE for decision in world.decisions[before:])
    assert all(decision.alarm is Alarm.DANGER and decision.command == STOP for decision in world.decisions[before:])
    assert "will_not_stop" in world.raised
    assert "nothing can be started or reset here" in world.ask(Request.START)
    assert "nothing can be started or reset here" in world.ask(Request.RESET)
    world.deaf.clear()
    world.run(9.75)
    assert world.is_in(State.UNCONTROLLABLE)
    assert world.decision.alarm is Alarm.DANGER
    world.until(State.TRIPPED, 1.0)
    assert world.decision.alarm is not Alarm.DANGER


@every_state
def test_no_alarm_but_in_uncontrollable(state: State) -> None:
    world = IN[state]()
    assert not world.decisions or world.is_in(state)
    assert all(
        (decision.alarm is Alarm.DANGER) is (decision.state is State.UNCONTROLLABLE) for decision in world.decisions
    )


# --- what proves a stop -----------------------------------------------------------------------------------------------


def shows_running(world: World) -> None:
    world.shows["operation"] = Operation.RUNNING


def shows_nothing(world: World) -> None:
    world.shows["operation"] = None


def delivers(world: World) -> None:
    world.leak_a = 0.51


def says_no_number(world: World) -> None:
    world.shows["current_a"] = float("nan")


def answers_late(world: World) -> None:
    """Always the answer to a request from before the newest stop."""
    world.shows["t_s"] = world.now_s


def writes_nothing(world: World) -> None:
    world.writes = False


NO_PROOF = (shows_running, shows_nothing, delivers, says_no_number, answers_late, writes_nothing)


@pytest.mark.parametrize("spoil", NO_PROOF, ids=lambda spoil: spoil.__name__)
def test_this_proves_nothing(spoil: Callable[[World], None]) -> None:
    world = charging()
    spoil(world)
    world.ask(Request.STOP)
    assert world.is_in(State.STOPPING)
    world.run(2.75)
    assert world.is_in(State.STOPPING)
    world.tick()  # DESIGN §6: 3 s
    assert world.is_in(State.UNCONTROLLABLE)
    assert all(decision.command == STOP for decision in world.decisions[-13:])


def test_half_an_ampere_is_standby() -> None:
    world = charging()
    world.leak_a = 0.5
    world.ask(Request.STOP)
    assert world.tick().state is State.STOPPING  # one reply is not enough
    assert world.tick().state is State.HELD
    assert world.decision.command is None


def test_a_stop_from_before_this_one_proves_nothing() -> None:
    world = charging()
    world.charger.resting = True  # it shows standby by itself
    world.writes = False
    sent_s = world.charger_link.stop_sent_s
    world.ask(Request.STOP)
    world.run(2)
    assert world.charger_link.stop_sent_s == sent_s
    assert world.is_in(State.STOPPING)
    world.writes = True
    assert world.tick().state is State.STOPPING
    assert world.tick().state is State.HELD


UNPROVED = "nothing has proved for 3 s that it obeyed the stop"


def test_the_evidence_says_why_the_stop_is_not_confirmed() -> None:
    for spoil, words in (
        (delivers, "it has not obeyed the stop for 3 s: it delivers 0.51 A; the BMU sees 0.5 A"),
        (shows_nothing, f"{UNPROVED}: its status does not show a standby that lasts; the BMU sees 0.0 A"),
        (answers_late, f"{UNPROVED}: no answer on /dev/ttyX; 0.00 A, last heard 3 s ago; the BMU sees 0.0 A"),
    ):
        world = charging()
        spoil(world)
        world.ask(Request.STOP)
        reason = reason_of(world.until(State.UNCONTROLLABLE))
        assert reason == (f"CUT THE MAINS of this charger (/dev/ttyX) now: {words}")


# --- at rest ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("begin", [idle, full, suspended], ids=lambda begin: begin.__name__)
def test_at_rest_nothing_is_ordered_as_long_as_standby_is_shown(begin: Callable[[], World]) -> None:
    world = begin()
    world.run(5)
    assert {decision.command for decision in world.decisions[-20:]} == {None}
    world.shows["operation"] = None  # one reading without an operation state
    assert world.tick().command == STOP
    world.shows.clear()
    assert world.tick().command is None


def test_a_charge_begins_from_a_stop_that_was_just_verified() -> None:
    world = World(soc_pct=99.0)
    world.until(State.IDLE)
    world.run(600, dt_s=1.0)
    world.writes = False
    world.values["soc_pct"] = 50.0
    world.until(State.QUALIFYING)
    world.run(30)
    assert world.is_in(State.QUALIFYING)
    assert world.decision.command == STOP
    world.writes = True
    world.run(0.5)
    assert world.is_in(State.CHARGING)


def test_nothing_begins_before_the_line_is_back_and_a_stop_is_verified_on_it() -> None:
    world = qualifying()
    world.charger_answers = world.writes = False
    world.until(State.OFFLINE)
    assert "/dev/ttyX: no answer" in reason_of(world.decision)
    world.values["temperature_c"] = 60.0  # a latch meanwhile does not leave OFFLINE: nothing is verified
    world.run(10)
    assert world.is_in(State.OFFLINE)
    world.charger_answers = True
    world.run(10)
    assert world.is_in(State.OFFLINE)
    assert reason_of(world.decision) == "the charger is being stopped before anything else"
    world.writes = True
    world.until(State.TRIPPED, 1.0)


@pytest.mark.parametrize("begin", [idle, full, suspended], ids=lambda begin: begin.__name__)
def test_a_latch_without_a_line_is_stopped_blindly_first(begin: Callable[[], World]) -> None:
    world = begin()
    world.charger_link = replace(world.charger_link, online=False, problem=cause("/dev/ttyX: no such port"))
    world.internal = "KeyError()"
    assert world.tick().command == STOP
    assert world.is_in(State.OFFLINE)
    world.charger_link = replace(world.charger_link, online=True, problem=None)
    world.until(State.TRIPPED, 1.0)


@pytest.mark.parametrize("begin", [idle, charging])
def test_a_stop_that_is_repeated_because_the_bmu_is_lost_says_so(begin: Callable[[], World]) -> None:
    """Its charger was verified: "is being stopped before anything else" would be untrue, and hide the BMU's reason."""
    world = begin()
    world.battery_answers = False
    world.until(State.OFFLINE, 6)
    told = [reason_of(world.run(0.25)) for _ in range(12)]
    assert all("the BMU (node 0x10)" in reason for reason in told), told
    again = [reason for reason in told if "told to stop once more, since no BMU confirms" in reason]
    assert again
    assert again != told, "it ends"


# --- the start --------------------------------------------------------------------------------------------------------


def test_the_start_stops_first_and_believes_only_its_own_stop() -> None:
    world = starting()
    world.charger_link = replace(world.charger_link, stop_sent_s=world.now_s - 10)
    world.writes = False
    world.run(2)
    assert all(decision.command == STOP and decision.state is State.STARTING for decision in world.decisions)
    world.writes = True
    assert world.tick().state is State.STARTING
    assert world.tick().state is State.IDLE


def test_a_charger_that_is_not_there_is_no_alarm() -> None:
    world = starting()
    world.charger_answers = False
    world.run(3)
    assert world.is_in(State.STARTING)
    world.tick()
    assert world.is_in(State.OFFLINE)
    assert reason_of(world.decision) == "/dev/ttyX: no answer"


def test_the_seconds_of_a_stop_in_vain_count_from_the_start() -> None:
    world = running_at_the_start()
    world.deaf.add(Action.STOP)
    world.until(State.UNCONTROLLABLE, 5)
    tried_s = re.findall(r"for (\d+) s", reason_of(world.decision))
    for later_s in (1, 2, 3):
        world.run(1.0)
        assert re.findall(r"for (\d+) s", reason_of(world.decision)) == [str(int(tried_s[0]) + later_s)]


def test_a_charger_that_is_found_late_has_its_time_to_stop() -> None:
    world = running_at_the_start()
    world.deaf.add(Action.STOP)
    world.charger_answers = world.battery_answers = False
    world.run(2.75)
    world.charger_answers = True
    world.run(3.0)
    assert world.is_in(State.STARTING)
    assert world.tick().state is State.UNCONTROLLABLE


def test_a_current_that_the_bmu_sees_at_the_start_is_given_three_seconds_whoever_answers() -> None:
    for answers in (True, False):
        world = running_at_the_start()
        world.deaf.add(Action.STOP)
        world.charger_answers = answers
        world.run(3.0)
        assert world.is_in(State.STARTING)
        assert world.tick().state is State.UNCONTROLLABLE
        assert world.decision.alarm is Alarm.DANGER


def test_a_charger_whose_status_never_becomes_valid_is_given_up() -> None:
    world = starting()
    world.shows["operation"] = None
    world.run(6)
    assert world.is_in(State.STARTING)
    assert world.tick().state is State.UNCONTROLLABLE


def test_a_charger_that_answers_now_and_then_stays_at_the_start() -> None:
    """Neither lost nor given up: a charger online without a fresh status is still being stopped."""
    world = starting()
    world.port_hangs = True
    world.run(20)
    assert world.is_in(State.STARTING)
    assert world.decision.command == STOP


def test_a_stop_is_never_given_up_for_long() -> None:
    """The command stands from the first decision on, and the machine stays where it is."""
    world = stopping()
    world.run(20, dt_s=TICK_S)
    assert world.states() == [
        State.STARTING,
        State.IDLE,
        State.QUALIFYING,
        State.CHARGING,
        State.STOPPING,
        State.UNCONTROLLABLE,
    ]


def test_a_charger_that_ran_at_the_start_has_been_stopped_once_already() -> None:
    world = running_at_the_start()
    world.until(State.HELD)
    for _ in range(2):
        world.run(3)
        assert not world.is_in(State.UNCONTROLLABLE)
        world.charger.resting, world.charger.run = False, True
        world.run(1)
    world.run(0.5)
    assert world.is_in(State.UNCONTROLLABLE)
