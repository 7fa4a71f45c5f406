"""A charger's port over a real pty, with a charger that shares nothing with the product, on good lines and bad."""

import fcntl
import os
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event

import pytest

from orchestrator.config.station import ChargerConfig, Limits
from orchestrator.devices import line_quality
from orchestrator.devices.charger import LOOK_S, REOPEN_S, ChargerPort
from orchestrator.devices.charger_line import ChargerLine
from orchestrator.errors import LinkError
from orchestrator.interlock import Grant
from orchestrator.keys import Range
from orchestrator.link.serial import SerialLine
from orchestrator.model import STOP, Action, ChargerLink, ChargerReading, Command, ControlMode, Operation, Sent
from tests.devices.fake_charger import (
    OPERATION_STOP,
    POLL,
    REST_RESUME,
    REST_STOP,
    RUN,
    STEP_2,
    FakeCharger,
    Shape,
    always,
    broken,
    bytewise,
    charger_on,
    delayed,
    garbage,
    lossy,
    perfect,
)
from tests.link.ptys import Pty, plugged
from tests.link.strangers import holding, stty
from tests.waiting import wait_until

LIMITS = Limits(voltage_v=58.4, current_a=15.0, temperature_c=Range(0.0, 45.0))
SET_STEP_2 = Command(Action.SET_LIMIT, 1)
ERROR_FRAME = bytes.fromhex("AF FA 90 07 1F 08 05 01 90 2D 81 AF A0")  # checksum error
SLACK_S = 0.1  #: what a busy machine may add to a time


def good(seconds: float = 60.0) -> Grant:
    return Grant(time.monotonic() + seconds, 50.0, 20.0, 1)


class Bench:
    """One running port."""

    def __init__(self, path: str, control: ControlMode, open_line: Callable[[], ChargerLine] | None = None) -> None:
        self.seen: list[tuple[ChargerReading | None, ChargerLink]] = []
        self.upset: Exception | None = None
        config = ChargerConfig(port=path, control=control, steps_a=(2.0, 5.0, 8.0, 11.0, 14.0))
        self.port = ChargerPort(
            config,
            LIMITS,
            open_line=open_line or (lambda: SerialLine.open(path)),
            clock=time.monotonic,
            on_change=self._changed,
        )

    def _changed(self) -> None:
        self.seen.append(self.port.view)
        if self.upset:
            raise self.upset

    @property
    def link(self) -> ChargerLink:
        return self.port.view[1]

    @property
    def reading(self) -> ChargerReading:
        reading = self.port.view[0]
        assert reading is not None
        return reading

    def wait_online(self, order: Command | None = STOP) -> None:
        """Online, with this standing order: a port that was just opened has one of its own."""
        wait_until(lambda: self.link.online, what="online")
        self.port.order(order, good())

    def wait_problem(self, text: str) -> None:
        wait_until(lambda: text in self.link.problem, what=f"the problem {text!r}")
        assert not self.link.online

    def wait_step(self, step: int) -> None:
        wait_until(lambda: self.reading.current_limit == step, what=f"step {step}")

    def wait_age(self, age_s: float) -> None:
        asked_s = self.reading.t_s
        wait_until(lambda: time.monotonic() >= asked_s + age_s)

    def wait_readings(self, count: int, *, since: int = 0) -> None:
        """So many different readings were reported, of all reports or those since one."""
        wait_until(lambda: len({reading.t_s for reading, _ in self.seen[since:] if reading}) >= count)


@contextmanager
def running(
    path: str, control: ControlMode = ControlMode.MANUAL, open_line: Callable[[], ChargerLine] | None = None
) -> Iterator[Bench]:
    bench = Bench(path, control, open_line)
    bench.port.start()
    try:
        yield bench
    finally:
        bench.port.close()


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[Pty]:
    with plugged(tmp_path / "port") as made:
        yield made


@pytest.fixture
def charger(pty: Pty) -> Iterator[FakeCharger]:
    with charger_on(pty) as made:
        yield made


@pytest.fixture
def bench(pty: Pty, charger: FakeCharger) -> Iterator[Bench]:
    """A port that only polls, and whose first stop is behind it."""
    with running(pty.path) as made:
        made.wait_online(order=None)
        yield made


def wait_frames(charger: FakeCharger, count: int) -> list[bytes]:
    wait_until(lambda: len(charger.frames) >= count, what=f"{count} frames")
    return [frame for _, frame in charger.frames[:count]]


# --- the ordinary course ---------------------------------------------------------------------------------------------


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
    assert (first.voltage_v, first.operation, first.current_limit) == (50.11, Operation.STOPPED, 0)
    assert asked_s - SLACK_S < first.t_s <= asked_s
    assert (bench.link.problem, bench.link.misses, bench.link.bad_frames) == ("", 0, 0)


def test_polls_are_a_slot_apart(bench: Bench, charger: FakeCharger) -> None:
    before = len(charger.frames)
    wait_frames(charger, before + 4)
    times_s = [at_s for at_s, _ in charger.frames[before:]]
    assert times_s[3] - times_s[0] > 3 * 0.2 - 0.05  # received a little late or early


def test_each_reading_is_reported(bench: Bench) -> None:
    count = len(bench.seen)
    bench.wait_readings(3, since=count)


def test_an_order_is_repeated_between_polls_until_it_is_withdrawn(bench: Bench, charger: FakeCharger) -> None:
    before = len(charger.frames)
    bench.port.order(SET_STEP_2, good())
    wait_until(lambda: charger.orders[-2:] == [STEP_2, STEP_2])
    bench.port.order(None)
    assert bench.reading.current_limit == 1
    assert bench.link.sent is not None
    assert bench.link.sent.command == SET_STEP_2
    count = len(charger.orders)
    polls = charger.polls
    wait_until(lambda: charger.polls >= polls + 3)
    assert len(charger.orders) == count
    middle = [frame[4] for _, frame in charger.frames[before:] if frame[4] in (1, 2)]
    assert middle[middle.index(2) :][:3] == [2, 1, 2]


def test_what_the_interlock_refuses_is_not_written_and_polls_go_on(bench: Bench, charger: FakeCharger) -> None:
    orders, polls = len(charger.orders), charger.polls
    bench.port.order(Command(Action.RUN))
    wait_until(lambda: bench.link.refused)
    assert bench.link.refused == "run: no fresh reading of charger, pack voltage and pack temperature"
    wait_until(lambda: charger.polls >= polls + 4)
    assert len(charger.orders) == orders
    assert bench.link.online
    bench.port.order(None)
    wait_until(lambda: not bench.link.refused)


def test_a_grant_that_runs_out_ends_a_standing_order(bench: Bench, charger: FakeCharger) -> None:
    bench.port.order(SET_STEP_2, good(0.5))
    wait_until(lambda: "too old" in bench.link.refused)
    assert charger.orders[-1] == STEP_2
    bench.port.order(SET_STEP_2, good())
    wait_until(lambda: not bench.link.refused)


# --- stopping --------------------------------------------------------------------------------------------------------


def test_a_stop_waits_for_no_slot(bench: Bench, charger: FakeCharger) -> None:
    """Ordered in the middle of an idle slot. The best of some tries counts, since the machine may be busy."""
    took_s = []
    for _ in range(3):
        bench.wait_readings(1, since=len(bench.seen))
        bench.wait_age(0.1)
        before = len(charger.frames)
        ordered_s = time.monotonic()
        bench.port.order(STOP)
        assert wait_frames(charger, before + 3)[before:] == [REST_STOP, OPERATION_STOP, POLL]
        took_s.append(charger.frames[before][0] - ordered_s)
        bench.port.order(None)
    assert min(took_s) < 0.05


def test_a_stop_waits_for_the_rest_of_a_transaction_and_no_longer(pty: Pty) -> None:
    with charger_on(pty, delayed(0.08)) as charger, running(pty.path) as bench:
        bench.wait_online(order=None)
        polls = charger.polls
        wait_until(lambda: charger.polls > polls)
        readings, before = len(bench.seen), len(charger.frames)
        ordered_s = time.monotonic()
        bench.port.order(STOP)
        wait_frames(charger, before + 1)
        stopped_s, frame = charger.frames[before]
        assert frame == REST_STOP
        assert 0.04 < stopped_s - ordered_s < 0.12 + SLACK_S / 2
        bench.wait_readings(1, since=readings)  # that transaction was not thrown away


def test_a_standing_stop_is_repeated_until_it_is_withdrawn(bench: Bench, charger: FakeCharger) -> None:
    before, orders = len(charger.frames), len(charger.orders)
    bench.port.order(STOP)
    wait_until(lambda: charger.orders[orders:] == [REST_STOP, OPERATION_STOP] * 3)
    bench.port.order(None)
    stops_s = [at_s for at_s, frame in charger.frames[before:] if frame == REST_STOP]
    assert stops_s[2] - stops_s[0] == pytest.approx(1.0, abs=SLACK_S)
    assert POLL in [frame for _, frame in charger.frames[before:]]


def test_a_silent_charger_is_told_to_stop_blindly(bench: Bench, charger: FakeCharger) -> None:
    charger.mute = True
    bench.wait_problem("no answer: check the charger's power")
    assert bench.link.misses == 5
    orders = len(charger.orders)
    bench.port.order(STOP)
    wait_until(lambda: charger.orders[orders:] == [REST_STOP, OPERATION_STOP] * 2)
    charger.mute = False
    bench.wait_online()
    assert (bench.link.problem, bench.link.misses) == ("", 0)


def test_close_writes_an_ordered_stop_whole_and_gives_the_port_back(
    pty: Pty, bench: Bench, charger: FakeCharger
) -> None:
    orders = len(charger.orders)
    bench.port.order(STOP)
    bench.port.close()
    wait_until(lambda: charger.orders[orders:] == [REST_STOP, OPERATION_STOP])
    SerialLine.open(pty.path).close()
    bench.port.close()


def test_close_orders_nothing_by_itself(bench: Bench, charger: FakeCharger) -> None:
    orders = len(charger.orders)
    bench.port.close()
    assert len(charger.orders) == orders


def test_close_of_a_port_that_was_never_started_or_never_there_returns_at_once(tmp_path: Path) -> None:
    path = str(tmp_path / "nothing")
    Bench(path, ControlMode.MANUAL).port.close()
    begun_s = time.monotonic()
    with running(path) as bench:
        bench.wait_problem("no such port")
    assert time.monotonic() - begun_s < 0.5


# --- lines as they are -----------------------------------------------------------------------------------------------

LINES: dict[str, Shape] = {
    "perfect": perfect,
    "byte by byte": bytewise,
    "delayed": delayed(0.06),
    "lossy": lossy(0.05),
    "garbage": garbage,
}


def test_every_line_that_answers_in_time_gives_its_readings_and_stays_online(tmp_path: Path) -> None:
    """All at once, to save time: 12 readings each, and an order, with and without an echo of what is sent."""
    with ExitStack() as stack:
        benches: dict[str, tuple[Bench, FakeCharger]] = {}
        for number, (name, shape) in enumerate(LINES.items()):
            for echo in (False, True):
                pty = stack.enter_context(plugged(tmp_path / f"{number}{echo}"))
                charger = stack.enter_context(charger_on(pty, shape, echo=echo))
                bench = stack.enter_context(running(pty.path))
                benches[f"{name}, {'' if echo else 'no '}echo"] = bench, charger
        for bench, _ in benches.values():
            bench.wait_online(SET_STEP_2)
        for bench, _ in benches.values():
            bench.wait_step(1)
            bench.port.order(None)
        for name, (bench, charger) in benches.items():
            bench.wait_readings(12)
            online = [link.online for _, link in bench.seen]
            assert all(online[online.index(True) :]), f"{name} went offline"
            assert bench.reading == replace(bench.reading, voltage_v=50.11, current_a=0.0, current_limit=1, illegal=())
            assert charger.running == 0, name


SILENT_LINES: dict[str, Shape] = {
    "it answers, but not in time": delayed(0.23),
    "only broken frames come in": broken,
    "it answers with error frames only": always(ERROR_FRAME),
    "no answer": always(b""),
}


def test_a_line_without_answers_is_silent_and_says_what_it_heard(tmp_path: Path) -> None:
    with ExitStack() as stack:
        for number, shape in enumerate(SILENT_LINES.values()):
            pty = stack.enter_context(plugged(tmp_path / f"{number}"))
            stack.enter_context(charger_on(pty, shape, echo=True))
        benches = [stack.enter_context(running(str(tmp_path / f"{number}"))) for number in range(len(SILENT_LINES))]
        for number, (bench, problem) in enumerate(zip(benches, SILENT_LINES, strict=True)):
            bench.wait_problem(f"{tmp_path}/{number}: {problem}")
            assert bench.port.view[0] is None
            assert not any(link.online for _, link in bench.seen)


def test_a_missed_answer_is_not_yet_silence(bench: Bench, charger: FakeCharger) -> None:
    charger.mute = True
    wait_until(lambda: bench.link.misses == 4)
    assert bench.link.online
    assert bench.link.problem == ""
    charger.mute = False
    wait_until(lambda: bench.link.misses == 0)
    assert all(link.online for _, link in bench.seen[-6:])


def test_answers_that_come_late_are_silence_sooner(bench: Bench, charger: FakeCharger) -> None:
    charger.shape = delayed(0.23)
    bench.wait_problem("it answers, but not in time")
    assert bench.link.misses == 3


def test_a_line_tells_how_much_of_it_goes_wrong(
    bench: Bench, charger: FakeCharger, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(line_quality, "LEAST", 4)
    charger.shape = always(ERROR_FRAME)
    wait_until(lambda: bench.link.misses == 3)
    charger.shape = perfect
    wait_until(lambda: bench.link.misses == 0)
    assert 30 <= bench.link.bad_pct < 100


def test_an_error_frame_is_reported_whenever_it_comes(bench: Bench, charger: FakeCharger) -> None:
    before_s = time.monotonic()
    charger.say(ERROR_FRAME)
    wait_until(lambda: bench.link.error_bits == 8)
    assert bench.link.error_t_s is not None
    assert bench.link.error_t_s >= before_s
    assert bench.link.online


def test_bad_frames_are_counted(bench: Bench, charger: FakeCharger) -> None:
    charger.say(REST_STOP[:-1] + b"\x00" + ERROR_FRAME[:-2] + bytes(2))
    wait_until(lambda: bench.link.bad_frames == 2)


def test_a_line_that_never_falls_quiet_does_not_hold_up_a_stop(bench: Bench, charger: FakeCharger) -> None:
    with charger.babbling():
        bench.wait_readings(2, since=len(bench.seen))  # answers are found in it
        charger.mute = True
        bench.wait_problem("only broken frames come in")
        orders = len(charger.orders)
        bench.port.order(STOP)
        wait_until(lambda: charger.orders[orders:] == [REST_STOP, OPERATION_STOP])
    charger.mute = False
    bench.wait_online()


def test_a_line_that_always_has_more_to_read_does_not_hold_up_a_stop() -> None:
    """Faster than any pty, so that reading never comes to an end."""

    class Endless:
        def __init__(self) -> None:
            self.written: list[bytes] = []

        def write(self, data: bytes) -> None:
            self.written.append(data)

        def read(self, timeout_s: float, expected: int = 0) -> bytes:
            return bytes(64)

        def restore(self) -> str:
            return ""

        def locked_by(self) -> str:
            return ""

        def close(self) -> None:
            pass

    line = Endless()
    with running("endless", open_line=lambda: line) as bench:
        wait_until(lambda: bench.link.misses)
        wait_until(lambda: line.written.count(REST_STOP) >= 2)


# --- ports as they are -----------------------------------------------------------------------------------------------


def test_an_unplugged_port_is_a_problem_and_stops_first_when_it_is_back(
    pty: Pty, bench: Bench, charger: FakeCharger
) -> None:
    bench.port.order(SET_STEP_2, good())
    wait_until(lambda: STEP_2 in charger.orders)
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
    assert (first.problem, first.misses, first.online) == (f"{pty.path}: open, no answer yet", 0, False)
    assert (bench.link.problem, bench.link.bad_frames) == ("", 0)


def test_an_order_given_while_the_port_was_away_is_not_carried_out(
    pty: Pty, bench: Bench, charger: FakeCharger
) -> None:
    pty.unplug()
    bench.wait_problem("unplugged")
    bench.port.order(Command(Action.RUN), good())
    pty.plug()
    bench.wait_online()
    wait_until(lambda: charger.orders[-4:] == [REST_STOP, OPERATION_STOP] * 2)
    assert RUN not in charger.orders
    bench.port.order(Command(Action.RESUME), good())
    wait_until(lambda: charger.orders[-1] == REST_RESUME)


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
        assert len(bench.seen) == 1  # that it is still not there is no news
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
        stops, failed_s = charger.orders.count(REST_STOP), time.monotonic()
        os.close(lines[-1].fileno())
        wait_until(lambda: charger.orders.count(REST_STOP) > stops, what="a stop")
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
        wait_until(lambda: f"(pid {stranger.pid})" in bench.link.locked_by, what="its name")
        bench.wait_online()
        stranger.communicate()
        wait_until(lambda: bench.link.locked_by == "", what="the lock")


# --- others who set it to something else -----------------------------------------------------------------------------


@pytest.fixture
def hard_of_hearing(pty: Pty, charger: FakeCharger) -> FakeCharger:
    """A charger that hears what comes at 19200 baud, as every real one does."""
    charger.baud = termios.B19200
    return charger


def test_a_stop_goes_out_at_the_right_speed_whatever_the_port_was_set_to(
    pty: Pty, bench: Bench, hard_of_hearing: FakeCharger
) -> None:
    bench.port.order(SET_STEP_2, good())
    wait_until(lambda: hard_of_hearing.orders[-1:] == [STEP_2])
    stty(pty.path, "115200", "echo")
    ordered_s = time.monotonic()
    bench.port.order(STOP)
    wait_until(lambda: hard_of_hearing.orders[-2:] == [REST_STOP, OPERATION_STOP])
    stop_s = next(at_s for at_s, frame in hard_of_hearing.frames if at_s > ordered_s and frame == REST_STOP)
    assert stop_s - ordered_s < 0.4, "not the one that is repeated after 500 ms"
    assert bench.link.taken_over == "115200 baud, echo on"
    assert bench.link.taken_over_t_s is not None
    assert time.monotonic() - bench.link.taken_over_t_s < 5


def test_a_line_that_was_set_to_something_else_recovers_by_itself(
    pty: Pty, bench: Bench, hard_of_hearing: FakeCharger
) -> None:
    """With the first poll that nobody answers: no stop is due, and the port is not opened anew."""
    for baud in ("9600", "300"):
        told = len(bench.seen)
        stty(pty.path, baud)
        wait_until(lambda baud=baud: bench.link.taken_over == f"{baud} baud")  # type: ignore[misc]
        bench.wait_readings(3, since=told)
        assert all(link.online and link.misses <= 2 for _, link in bench.seen[told:])


def test_what_does_no_harm_at_once_is_set_right_within_a_second(pty: Pty, bench: Bench, charger: FakeCharger) -> None:
    stty(pty.path, "opost")
    began_s = time.monotonic()
    wait_until(lambda: bench.link.taken_over == "translated output")
    assert time.monotonic() - began_s < LOOK_S + 0.5
    assert bench.link.misses == 0


def test_settings_that_cannot_be_asked_for_keep_no_stop_back(
    pty: Pty, charger: FakeCharger, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = SerialLine.open(pty.path)

    def not_now() -> str:
        raise LinkError("not now")

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


# --- errors of our own -----------------------------------------------------------------------------------------------


def test_an_exception_in_the_thread_stops_the_charger_and_is_told(bench: Bench, charger: FakeCharger) -> None:
    bench.port.order(SET_STEP_2, good())
    wait_until(lambda: charger.orders[-1] == STEP_2)
    orders = len(charger.orders)
    bench.upset = RuntimeError("a mistake of ours")
    bench.wait_problem("internal: RuntimeError: a mistake of ours")
    bench.upset = None
    wait_until(lambda: charger.orders[orders:][-2:] == [REST_STOP, OPERATION_STOP])
    bench.wait_online()
    assert bench.link.problem == ""


def test_an_exception_that_comes_again_each_time_never_ends_the_stops_nor_floods_the_line(
    bench: Bench, charger: FakeCharger
) -> None:
    bench.upset = RuntimeError("for ever")
    bench.wait_problem("internal")
    count = charger.orders.count(REST_STOP)
    begun_s = time.monotonic()
    wait_until(lambda: charger.orders.count(REST_STOP) >= count + 4)
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
    assert bench.port.stalled(time.monotonic() + 0.8)  # as if no turn had been taken for so long
    pty.unplug()
    bench.wait_problem("unplugged")
    assert not bench.port.stalled(time.monotonic() + 0.8)
    bench.port.close()
    assert not bench.port.stalled(time.monotonic())
