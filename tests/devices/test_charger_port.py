"""A charger port over a real pty: polls, standing commands, and the interlock before them."""

from orchestrator.model import STOP, Action, Command, ControlMode, Operation, Sent
from tests.core.said import say
from tests.devices.fake_charger import OPERATION_STOP, POLL, REST_STOP, STEP_2, FakeCharger
from tests.devices.port_bench import SET_STEP_2, SLACK_S, Bench, good, running, wait_frames
from tests.link.ptys import Pty
from tests.waiting import wait_until


def test_an_opened_port_stops_the_whole_charger_before_it_asks_anything(pty: Pty, charger: FakeCharger) -> None:
    with running(pty.path) as bench:
        assert wait_frames(charger, 4) == [REST_STOP, OPERATION_STOP, POLL, REST_STOP]
        bench.wait_online()
        assert bench.link.sent is not None
        assert bench.link.sent.command == STOP
        assert bench.link.stop_sent_s is not None
        assert bench.link.stop_sent_s < bench.reading.t_s


def test_in_automatic_mode_a_stop_is_one_frame(pty: Pty, charger: FakeCharger) -> None:
    with running(pty.path, ControlMode.AUTOMATIC) as bench:
        assert wait_frames(charger, 5) == [REST_STOP, POLL, POLL, REST_STOP, POLL]
        wait_until(lambda: bench.link.stop_sent_s == (bench.link.sent or Sent(STOP, 0.0)).t_s)


def test_a_reading_is_what_the_charger_said_as_old_as_its_request(bench: Bench, charger: FakeCharger) -> None:
    asked_s = next(at_s for at_s, frame in charger.frames if frame == POLL)
    first = next(reading for reading, _ in bench.seen if reading)
    assert (first.voltage_v, first.operation, first.current_step) == (50.11, Operation.STOPPED, 0)
    assert asked_s - SLACK_S < first.t_s <= asked_s
    assert (say(bench.link.problem), bench.link.misses, bench.link.bad_frames) == ("", 0, 0)


def test_polls_are_a_slot_apart(bench: Bench, charger: FakeCharger) -> None:
    before = len(charger.frames)
    wait_frames(charger, before + 4)
    times_s = [at_s for at_s, _ in charger.frames[before:]]
    assert times_s[3] - times_s[0] > 3 * 0.2 - 0.05  # received slightly late or early


def test_each_reading_is_reported(bench: Bench) -> None:
    count = len(bench.seen)
    bench.wait_readings(3, since=count)


def test_an_order_is_repeated_between_polls_until_it_is_withdrawn(bench: Bench, charger: FakeCharger) -> None:
    before = len(charger.frames)
    bench.port.command(SET_STEP_2, good())
    wait_until(lambda: charger.commands[-2:] == [STEP_2, STEP_2])
    bench.port.command(None)
    assert bench.reading.current_step == 1
    assert bench.link.sent is not None
    assert bench.link.sent.command == SET_STEP_2
    count = len(charger.commands)
    polls = charger.polls
    wait_until(lambda: charger.polls >= polls + 3)
    assert len(charger.commands) == count
    middle = [frame[4] for _, frame in charger.frames[before:] if frame[4] in (1, 2)]
    assert middle[middle.index(2) :][:3] == [2, 1, 2]


def test_what_the_interlock_refuses_is_not_written_and_polls_go_on(bench: Bench, charger: FakeCharger) -> None:
    commands, polls = len(charger.commands), charger.polls
    bench.port.command(Command(Action.RUN))
    wait_until(lambda: bench.link.refused)
    assert say(bench.link.refused) == "run: no fresh reading of charger, pack voltage and pack temperature"
    wait_until(lambda: charger.polls >= polls + 4)
    assert len(charger.commands) == commands
    assert bench.link.online
    bench.port.command(None)
    wait_until(lambda: not bench.link.refused)


def test_a_grant_that_runs_out_ends_a_standing_order(bench: Bench, charger: FakeCharger) -> None:
    bench.port.command(SET_STEP_2, good(0.5))
    wait_until(lambda: "too old" in say(bench.link.refused))
    assert charger.commands[-1] == STEP_2
    bench.port.command(SET_STEP_2, good())
    wait_until(lambda: not bench.link.refused)
