"""Ports that are unplugged, missing, failing, or used by another program."""

import fcntl
import os
import time
from pathlib import Path

from orchestrator.devices.charger import REOPEN_S
from orchestrator.devices.charger_line import ChargerLine
from orchestrator.link.serial import SerialLine
from orchestrator.model import Action, Command
from tests.core.said import say
from tests.devices.fake_charger import (
    OPERATION_STOP,
    POLL,
    REST_RESUME,
    REST_STOP,
    RUN,
    STEP_2,
    FakeCharger,
    charger_on,
)
from tests.devices.port_bench import SET_STEP_2, Bench, good, running, wait_frames
from tests.link.ptys import Pty, plugged
from tests.link.strangers import holding
from tests.waiting import wait_until


def test_an_unplugged_port_is_a_problem_and_stops_first_when_it_is_back(
    pty: Pty, bench: Bench, charger: FakeCharger
) -> None:
    bench.port.command(SET_STEP_2, good())
    wait_until(lambda: STEP_2 in charger.commands)
    charger.say(REST_STOP[:-1] + bytes(1))
    wait_until(lambda: bench.link.bad_frames)
    charger.mute = True
    wait_until(lambda: bench.link.misses)
    reading = bench.reading
    pty.unplug()
    bench.wait_problem(f"{pty.path}: the adapter was unplugged")
    bench.wait_problem(f"{pty.path}: no such port")
    assert bench.reading.t_s >= reading.t_s  # the last one stays, with its age
    charger.mute = False
    frames, seen = len(charger.frames), len(bench.seen)
    pty.plug()
    assert wait_frames(charger, frames + 4)[frames:] == [REST_STOP, OPERATION_STOP, POLL, REST_STOP]
    bench.wait_online()
    first = bench.seen[seen][1]
    assert (say(first.problem), first.misses, first.online) == (f"{pty.path}: open, no answer yet", 0, False)
    assert (say(bench.link.problem), bench.link.bad_frames) == ("", 0)


def test_an_order_given_while_the_port_was_away_is_not_carried_out(
    pty: Pty, bench: Bench, charger: FakeCharger
) -> None:
    pty.unplug()
    bench.wait_problem("unplugged")
    bench.port.command(Command(Action.RUN), good())
    pty.plug()
    bench.wait_online()
    wait_until(lambda: charger.commands[-4:] == [REST_STOP, OPERATION_STOP] * 2)
    assert RUN not in charger.commands
    bench.port.command(Command(Action.RESUME), good())
    wait_until(lambda: charger.commands[-1] == REST_RESUME)


def test_a_port_that_appears_later_works(tmp_path: Path) -> None:
    with running(str(tmp_path / "port")) as bench:
        bench.wait_problem("no such port")
        with plugged(tmp_path / "port") as pty, charger_on(pty):
            bench.wait_online()


def test_opening_is_tried_once_a_second(pty: Pty, charger: FakeCharger) -> None:
    tried_s: list[float] = []

    def open_line() -> ChargerLine:
        tried_s.append(time.monotonic())
        return SerialLine.open(pty.path)

    pty.unplug()
    with running(pty.path, open_line=open_line) as bench:
        wait_until(lambda: len(tried_s) == 3)
        assert len(bench.seen) == 1  # still missing: nothing new to report
        pty.plug()
        bench.wait_online()
        pty.unplug()
        bench.wait_problem("unplugged")
        opened = len(tried_s)
        wait_until(lambda: len(tried_s) > opened)
    for one in (1, opened):
        assert 0.9 < tried_s[one] - tried_s[one - 1] < 1.5


def test_a_port_that_fails_after_a_while_is_opened_at_once_and_its_charger_stopped(
    pty: Pty, charger: FakeCharger
) -> None:
    lines: list[SerialLine] = []

    def open_line() -> ChargerLine:
        lines.append(SerialLine.open(pty.path))
        return lines[-1]

    with running(pty.path, open_line=open_line) as bench:
        bench.wait_online()
        served_s = time.monotonic() + REOPEN_S
        wait_until(lambda: time.monotonic() > served_s, what="a second of service")
        stops, failed_s = charger.commands.count(REST_STOP), time.monotonic()
        os.close(lines[-1].fileno())
        wait_until(lambda: charger.commands.count(REST_STOP) > stops, what="a stop")
        assert time.monotonic() - failed_s < 0.5 * REOPEN_S


def test_a_port_that_another_orchestrator_holds_is_taken_once_it_is_free(pty: Pty, charger: FakeCharger) -> None:
    with Path(pty.path).open("rb", buffering=0) as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with running(pty.path) as bench:
            bench.wait_problem("in use: another program holds it")
            assert charger.frames == []
            fcntl.flock(other, fcntl.LOCK_UN)
            bench.wait_online()


def test_a_strangers_lock_is_told_and_the_charger_stopped_all_the_same(pty: Pty, charger: FakeCharger) -> None:
    with holding(pty.path) as stranger, running(pty.path) as bench:
        assert wait_frames(charger, 2) == [REST_STOP, OPERATION_STOP]
        wait_until(lambda: f"(pid {stranger.pid})" in say(bench.link.locked_by), what="its name")
        bench.wait_online()
        stranger.communicate()
        wait_until(lambda: say(bench.link.locked_by) == "", what="the lock")
