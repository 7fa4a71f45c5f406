"""Internal errors in a port's thread, and threads that hang."""

import time
from threading import Event

from orchestrator.devices.charger_line import ChargerLine
from orchestrator.link.serial import SerialLine
from orchestrator.model import ControlMode
from tests.core.said import say
from tests.devices.fake_charger import OPERATION_STOP, REST_STOP, STEP_2, FakeCharger
from tests.devices.port_bench import SET_STEP_2, Bench, good, running
from tests.link.ptys import Pty
from tests.waiting import wait_until


def test_an_exception_in_the_thread_stops_the_charger_and_is_told(bench: Bench, charger: FakeCharger) -> None:
    bench.port.command(SET_STEP_2, good())
    wait_until(lambda: charger.commands[-1] == STEP_2)
    commands = len(charger.commands)
    bench.upset = RuntimeError("a mistake of ours")
    bench.wait_problem("internal: RuntimeError: a mistake of ours")
    bench.upset = None
    wait_until(lambda: charger.commands[commands:][-2:] == [REST_STOP, OPERATION_STOP])
    bench.wait_online()
    assert say(bench.link.problem) == ""


def test_an_exception_that_comes_again_each_time_never_ends_the_stops_nor_floods_the_line(
    bench: Bench, charger: FakeCharger
) -> None:
    bench.upset = RuntimeError("for ever")
    bench.wait_problem("internal")
    count = charger.commands.count(REST_STOP)
    begun_s = time.monotonic()
    wait_until(lambda: charger.commands.count(REST_STOP) >= count + 4)
    assert time.monotonic() - begun_s > 0.5
    bench.upset = None
    bench.wait_online()


def test_an_exception_while_opening_is_told_and_tried_again(pty: Pty, charger: FakeCharger) -> None:
    failures = [RuntimeError("not yet")]

    def open_line() -> ChargerLine:
        if failures:
            raise failures.pop()
        return SerialLine.open(pty.path)

    with running(pty.path, open_line=open_line) as bench:
        bench.wait_problem("internal: RuntimeError: not yet")
        bench.wait_online()


def test_a_line_that_cannot_even_be_closed_does_not_end_the_thread(pty: Pty, charger: FakeCharger) -> None:
    class Sticky(SerialLine):
        def close(self) -> None:
            super().close()
            raise RuntimeError("not now")

    with running(pty.path, open_line=lambda: Sticky.open(pty.path)) as bench:
        bench.wait_online()
        pty.unplug()
        bench.wait_problem("no such port")
        pty.plug()
        bench.wait_online()


def test_a_close_that_hangs_is_no_line_that_is_well(pty: Pty, charger: FakeCharger) -> None:
    goes_on = Event()

    class Stuck(SerialLine):
        def close(self) -> None:
            goes_on.wait(30)
            super().close()

    with running(pty.path, open_line=lambda: Stuck.open(pty.path)) as bench:
        bench.wait_online()
        pty.unplug()
        bench.wait_problem("unplugged")
        goes_on.set()
        pty.plug()
        bench.wait_online()


def test_a_thread_that_hangs_or_has_ended_is_told_from_one_that_waits_for_its_port(
    pty: Pty, bench: Bench, charger: FakeCharger
) -> None:
    assert Bench(pty.path, ControlMode.MANUAL).port.stalled(time.monotonic())  # it does not run
    assert not bench.port.stalled(time.monotonic())
    assert bench.port.stalled(time.monotonic() + 0.8)  # as if no turn had been taken for that long
    pty.unplug()
    bench.wait_problem("unplugged")
    assert not bench.port.stalled(time.monotonic() + 0.8)
    bench.port.close()
    assert not bench.port.stalled(time.monotonic())
