"""Ports whose settings another program changes."""

import termios
import time

import pytest

from orchestrator.devices.charger import LOOK_S
from orchestrator.errors import LinkError
from orchestrator.link.serial import SerialLine
from orchestrator.model import STOP
from tests.core.said import cause, say
from tests.devices.fake_charger import OPERATION_STOP, POLL, REST_STOP, STEP_2, FakeCharger
from tests.devices.port_bench import SET_STEP_2, Bench, good, running, wait_frames
from tests.link.ptys import Pty
from tests.link.strangers import stty
from tests.waiting import wait_until


@pytest.fixture
def hard_of_hearing(pty: Pty, charger: FakeCharger) -> FakeCharger:
    """A charger that hears only 19200 baud, like every real one."""
    charger.baud = termios.B19200
    return charger


def test_a_stop_goes_out_at_the_right_speed_whatever_the_port_was_set_to(
    pty: Pty, bench: Bench, hard_of_hearing: FakeCharger
) -> None:
    bench.port.command(SET_STEP_2, good())
    wait_until(lambda: hard_of_hearing.commands[-1:] == [STEP_2])
    stty(pty.path, "115200", "echo")
    ordered_s = time.monotonic()
    bench.port.command(STOP)
    wait_until(lambda: hard_of_hearing.commands[-2:] == [REST_STOP, OPERATION_STOP])
    stop_s = next(at_s for at_s, frame in hard_of_hearing.frames if at_s > ordered_s and frame == REST_STOP)
    assert stop_s - ordered_s < 0.4, "not the one that is repeated after 500 ms"
    assert say(bench.link.taken_over) == "115200 baud, echo on"
    assert bench.link.taken_over_t_s is not None
    assert time.monotonic() - bench.link.taken_over_t_s < 5


def test_a_line_that_was_set_to_something_else_recovers_by_itself(
    pty: Pty, bench: Bench, hard_of_hearing: FakeCharger
) -> None:
    """At the first unanswered poll: no stop is due, and the port is not reopened."""
    for baud in ("9600", "300"):
        told = len(bench.seen)
        stty(pty.path, baud)
        wait_until(lambda baud=baud: say(bench.link.taken_over) == f"{baud} baud")  # type: ignore[misc]
        bench.wait_readings(3, since=told)
        assert all(link.online and link.misses <= 2 for _, link in bench.seen[told:])


def test_what_does_no_harm_at_once_is_set_right_within_a_second(pty: Pty, bench: Bench, charger: FakeCharger) -> None:
    stty(pty.path, "opost")
    began_s = time.monotonic()
    wait_until(lambda: say(bench.link.taken_over) == "translated output")
    assert time.monotonic() - began_s < LOOK_S + 0.5
    assert bench.link.misses == 0


def test_settings_that_cannot_be_asked_for_keep_no_stop_back(
    pty: Pty, charger: FakeCharger, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = SerialLine.open(pty.path)

    def not_now() -> str:
        raise LinkError(cause("not now"))

    monkeypatch.setattr(line, "restore", not_now)
    with running(pty.path, open_line=lambda: line) as bench:
        assert wait_frames(charger, 3) == [REST_STOP, OPERATION_STOP, POLL]
        bench.wait_online()


def test_a_stalled_line_is_a_problem_and_stops_first_when_it_moves_again(
    pty: Pty, bench: Bench, charger: FakeCharger
) -> None:
    charger.stop_reading()
    pty.fill()
    bench.wait_problem(f"{pty.path}: stalled")
    pty.drain()
    frames = len(charger.frames)
    charger.go_on_reading()
    assert wait_frames(charger, frames + 2)[frames:] == [REST_STOP, OPERATION_STOP]
    bench.wait_online()
