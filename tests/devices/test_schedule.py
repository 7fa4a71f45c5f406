"""Which frame is next on the line, in simulated time."""

from collections.abc import Mapping
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.devices.schedule import ORDER_S, SLOT_S, STOP_REPEAT_S, Schedule, Turn
from orchestrator.model import STOP, Action, Command, ControlMode

POLL, ORDER, REST, OPERATION = Turn.POLL, Turn.ORDER, Turn.STOP, Turn.OPERATION_STOP
RUN = Command(Action.RUN)
POLL_S = 0.02  #: a transaction

Log = list[tuple[float, Turn]]


def play(
    schedule: Schedule, start_s: float, end_s: float, commands: Mapping[float, Command | None], poll_s: float = POLL_S
) -> Log:
    """Take every turn when due; give commands at their times, like a control loop while the port sleeps."""
    log: Log = []
    now_s = start_s
    waiting = sorted(commands.items(), key=lambda item: item[0])
    while True:
        due = schedule.next()
        at_s = max(now_s, due.at_s)
        if waiting and waiting[0][0] <= at_s:
            given_s, command = waiting.pop(0)
            schedule.give(command)
            now_s = max(now_s, given_s)
            continue
        if at_s >= end_s:
            return log
        now_s = at_s + (poll_s if due.turn is POLL else 0.0)
        schedule.took(due.turn, at_s, now_s)
        log.append((round(at_s, 3), due.turn))


def opened(control: ControlMode = ControlMode.MANUAL, at_s: float = 0.0) -> Schedule:
    schedule = Schedule(control)
    schedule.restart(at_s)
    return schedule


def polling(control: ControlMode = ControlMode.MANUAL) -> Schedule:
    """A schedule past its first stop, last poll at 1.6 s; the next slot is at 1.8 s."""
    schedule = opened(control)
    log = play(schedule, 0.0, 1.7, {0.1: None})
    assert log[-1] == (1.6, POLL)
    return schedule


def test_without_an_order_every_slot_is_a_poll() -> None:
    assert play(polling(), 1.7, 2.7, {}) == [(1.8, POLL), (2.0, POLL), (2.2, POLL), (2.4, POLL), (2.6, POLL)]


def test_an_order_takes_turns_with_polls_until_it_is_changed() -> None:
    log = play(polling(), 1.7, 2.9, {1.75: RUN, 2.5: None})
    assert log == [(1.8, ORDER), (2.0, POLL), (2.2, ORDER), (2.4, POLL), (2.6, POLL), (2.8, POLL)]


def test_an_order_waits_for_its_slot() -> None:
    assert play(polling(), 1.7, 1.9, {1.65: RUN}) == [(1.8, ORDER)]


def test_another_order_does_not_take_the_polls_turn() -> None:
    log = play(polling(), 1.7, 2.3, {1.75: RUN, 1.9: Command(Action.SET_LIMIT, 1)})
    assert log == [(1.8, ORDER), (2.0, POLL), (2.2, ORDER)]


def test_in_manual_mode_a_stop_is_a_pair_repeated_every_half_second_with_polls_between() -> None:
    log = play(polling(), 1.7, 3.3, {1.71: STOP})
    assert log == [
        (1.71, REST), (1.91, OPERATION), (2.11, POLL),
        (2.21, REST), (2.41, OPERATION), (2.61, POLL),
        (2.71, REST), (2.91, OPERATION), (3.11, POLL), (3.21, REST),
    ]  # fmt: skip


def test_in_automatic_mode_a_stop_is_one_frame() -> None:
    log = play(polling(ControlMode.AUTOMATIC), 1.7, 2.75, {1.71: STOP})
    assert log == [(1.71, REST), (1.91, POLL), (2.11, POLL), (2.21, REST), (2.41, POLL), (2.61, POLL), (2.71, REST)]


def test_a_silent_charger_is_still_told_to_stop_every_half_second() -> None:
    log = play(polling(), 1.7, 4.3, {1.71: STOP}, poll_s=0.12)
    stops = [at_s for at_s, turn in log if turn is REST]
    assert stops == [1.71, 2.23, 2.75, 3.27, 3.79]  # a poll that ran to its deadline delays it by 20 ms
    assert [turn for _, turn in log].count(POLL) == 5


def test_a_stop_waits_for_no_slot_only_for_the_order_that_is_on_the_wire() -> None:
    schedule = polling()
    schedule.give(RUN)
    schedule.took(ORDER, 1.8, 1.801)
    assert schedule.give(STOP)
    due = schedule.next()
    assert due.turn is REST
    assert due.at_s == pytest.approx(1.801 + ORDER_S)


def test_a_stop_after_a_poll_is_due_at_once() -> None:
    schedule = polling()
    schedule.give(STOP)
    assert schedule.next().turn is REST
    assert schedule.next().at_s <= 1.7


def test_only_a_new_stop_wakes_the_port() -> None:
    schedule = polling()
    assert not schedule.give(RUN)
    assert schedule.give(STOP)
    assert not schedule.give(STOP)
    assert not schedule.give(None)
    assert schedule.give(Command(Action.STOP, 7))


def test_a_stop_ordered_again_before_its_repetition_goes_out_at_once() -> None:
    log = play(polling(), 1.7, 2.0, {1.71: STOP, 1.72: None, 1.75: STOP})
    assert log == [(1.71, REST), (1.75, REST), (1.95, OPERATION)]


def test_an_order_cannot_cut_a_stop_short() -> None:
    log = play(polling(), 1.7, 2.2, {1.71: STOP, 1.72: Command(Action.RESUME)})
    assert log == [(1.71, REST), (1.91, OPERATION), (2.11, POLL)]


def test_a_stop_that_is_withdrawn_before_its_turn_is_written_all_the_same() -> None:
    schedule = polling()
    schedule.give(STOP)
    schedule.give(RUN)
    assert play(schedule, 1.7, 2.4, {}) == [(1.7, REST), (1.9, OPERATION), (2.1, POLL), (2.3, ORDER)]


def test_a_new_schedule_begins_with_a_stop_at_once() -> None:
    assert play(Schedule(ControlMode.MANUAL), 10.0, 10.6, {}) == [
        (10.0, REST), (10.2, OPERATION), (10.4, POLL), (10.5, REST),
    ]  # fmt: skip


def test_an_opened_port_stops_first_whatever_was_ordered() -> None:
    schedule = polling()
    schedule.give(RUN)
    schedule.restart(10.0)
    assert schedule.stopping
    assert play(schedule, 10.0, 10.6, {}) == [(10.0, REST), (10.2, OPERATION), (10.4, POLL), (10.5, REST)]


def test_an_order_given_right_after_opening_comes_behind_the_whole_stop() -> None:
    schedule = opened(at_s=10.0)
    assert play(schedule, 10.0, 10.7, {10.0: RUN}) == [(10.0, REST), (10.2, OPERATION), (10.4, POLL), (10.6, ORDER)]


def test_restarts_in_a_row_are_paced() -> None:
    """An internal error that recurs at every stop must not flood the line."""
    schedule = polling()
    at_s = []
    now_s = 5.0
    for _ in range(4):
        schedule.restart(now_s)
        now_s = max(now_s, schedule.next().at_s)
        at_s.append(round(now_s, 3))
    assert at_s == [5.0, 5.2, 5.4, 5.6]


@pytest.mark.parametrize("control", ControlMode)
def test_a_stop_is_unfinished_until_its_last_frame_is_written(control: ControlMode) -> None:
    schedule = polling(control)
    assert not schedule.stop_unfinished
    schedule.give(STOP)
    assert schedule.stop_unfinished
    schedule.took(REST, 1.7, 1.7)
    assert schedule.stop_unfinished == (control is ControlMode.MANUAL)
    schedule.took(OPERATION, 1.9, 1.9)
    assert not schedule.stop_unfinished


COMMANDS = st.none() | st.sampled_from([STOP, RUN, Command(Action.RESUME), Command(Action.SET_LIMIT, 2)])


@given(
    commands=st.dictionaries(st.floats(0.0, 8.0), COMMANDS, max_size=30),
    control=st.sampled_from(ControlMode),
    poll_s=st.sampled_from([0.0, 0.02, 0.12]),
)
def test_whatever_is_ordered_when(commands: dict[float, Command | None], control: ControlMode, poll_s: float) -> None:
    log = play(opened(control), 0.0, 10.0, commands, poll_s)
    assert log[0] == (0.0, REST)
    busy_s = {POLL: poll_s, ORDER: ORDER_S, REST: ORDER_S, OPERATION: ORDER_S}
    for (before_s, before), (at_s, turn) in pairwise(log):
        # Frames never collide, and all but the stop keep the recommended 200 ms.
        assert at_s - before_s >= (busy_s[before] if turn is REST else SLOT_S) - 0.0015
        if before is REST and control is ControlMode.MANUAL:
            assert turn in (REST, OPERATION)
        if before is ORDER:
            assert turn in (REST, POLL)
    for given_s, command in commands.items():
        if command == STOP:
            assert any(
                given_s - STOP_REPEAT_S <= at_s <= given_s + poll_s + ORDER_S + 0.001
                for at_s, turn in log
                if turn is REST
            )
    if control is ControlMode.AUTOMATIC:
        assert OPERATION not in {turn for _, turn in log}
