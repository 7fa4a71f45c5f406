"""How a charger port stops: at once, repeatedly, blind, and when it closes."""

import time
from pathlib import Path

import pytest

from orchestrator.link.serial import SerialLine
from orchestrator.model import STOP, ControlMode
from tests.core.said import say
from tests.devices.fake_charger import OPERATION_STOP, POLL, REST_STOP, FakeCharger, charger_on, delayed
from tests.devices.port_bench import SLACK_S, Bench, running, wait_frames
from tests.link.ptys import Pty
from tests.waiting import wait_until


def test_a_stop_waits_for_no_slot(bench: Bench, charger: FakeCharger) -> None:
    """Commanded in the middle of an idle slot. The best of several tries counts: the machine may be busy."""
    took_s = []
    for _ in range(3):
        bench.wait_readings(1, since=len(bench.seen))
        bench.wait_age(0.1)
        before = len(charger.frames)
        ordered_s = time.monotonic()
        bench.port.command(STOP)
        assert wait_frames(charger, before + 3)[before:] == [REST_STOP, OPERATION_STOP, POLL]
        took_s.append(charger.frames[before][0] - ordered_s)
        bench.port.command(None)
    assert min(took_s) < 0.05


def test_a_stop_waits_for_the_rest_of_a_transaction_and_no_longer(pty: Pty) -> None:
    with charger_on(pty, delayed(0.08)) as charger, running(pty.path) as bench:
        bench.wait_online(command=None)
        polls = charger.polls
        wait_until(lambda: charger.polls > polls)
        readings, before = len(bench.seen), len(charger.frames)
        ordered_s = time.monotonic()
        bench.port.command(STOP)
        wait_frames(charger, before + 1)
        stopped_s, frame = charger.frames[before]
        assert frame == REST_STOP
        assert 0.04 < stopped_s - ordered_s < 0.12 + SLACK_S / 2
        bench.wait_readings(1, since=readings)  # that transaction was not thrown away


def test_a_standing_stop_is_repeated_until_it_is_withdrawn(bench: Bench, charger: FakeCharger) -> None:
    before, commands = len(charger.frames), len(charger.commands)
    bench.port.command(STOP)
    wait_until(lambda: charger.commands[commands:] == [REST_STOP, OPERATION_STOP] * 3)
    bench.port.command(None)
    stops_s = [at_s for at_s, frame in charger.frames[before:] if frame == REST_STOP]
    assert stops_s[2] - stops_s[0] == pytest.approx(1.0, abs=SLACK_S)
    assert POLL in [frame for _, frame in charger.frames[before:]]


def test_a_silent_charger_is_told_to_stop_blindly(bench: Bench, charger: FakeCharger) -> None:
    charger.mute = True
    bench.wait_problem("no answer: check the charger's power")
    assert bench.link.misses == 5
    commands = len(charger.commands)
    bench.port.command(STOP)
    wait_until(lambda: charger.commands[commands:] == [REST_STOP, OPERATION_STOP] * 2)
    charger.mute = False
    bench.wait_online()
    assert (say(bench.link.problem), bench.link.misses) == ("", 0)


def test_close_writes_an_ordered_stop_whole_and_gives_the_port_back(
    pty: Pty, bench: Bench, charger: FakeCharger
) -> None:
    commands = len(charger.commands)
    bench.port.command(STOP)
    bench.port.close()
    wait_until(lambda: charger.commands[commands:] == [REST_STOP, OPERATION_STOP])
    SerialLine.open(pty.path).close()
    bench.port.close()


def test_close_orders_nothing_by_itself(bench: Bench, charger: FakeCharger) -> None:
    commands = len(charger.commands)
    bench.port.close()
    assert len(charger.commands) == commands


def test_close_of_a_port_that_was_never_started_or_never_there_returns_at_once(tmp_path: Path) -> None:
    path = str(tmp_path / "nothing")
    Bench(path, ControlMode.MANUAL).port.close()
    begun_s = time.monotonic()
    with running(path) as bench:
        bench.wait_problem("no such port")
    assert time.monotonic() - begun_s < 0.5
