"""A charger port on good and bad lines: its answers, its silences, and its reports of them."""

import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.devices import line_quality
from orchestrator.model import STOP
from tests.core.said import say
from tests.devices.fake_charger import (
    OPERATION_STOP,
    REST_STOP,
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
from tests.devices.port_bench import SET_STEP_2, Bench, running
from tests.link.ptys import plugged
from tests.waiting import wait_until

ERROR_FRAME = bytes.fromhex("AF FA 90 07 1F 08 05 01 90 2D 81 AF A0")  # checksum error
LINES: dict[str, Shape] = {
    "perfect": perfect,
    "byte by byte": bytewise,
    "delayed": delayed(0.06),
    "lossy": lossy(0.05),
    "garbage": garbage,
}


def test_every_line_that_answers_in_time_gives_its_readings_and_stays_online(tmp_path: Path) -> None:
    """All at once, to save time: 12 readings each and a command, with and without echo."""
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
            bench.port.command(None)
        for name, (bench, charger) in benches.items():
            bench.wait_readings(12)
            online = [link.online for _, link in bench.seen]
            assert all(online[online.index(True) :]), f"{name} went offline"
            assert bench.reading == replace(bench.reading, voltage_v=50.11, current_a=0.0, current_step=1, illegal=())
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
    assert say(bench.link.problem) == ""
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
        commands = len(charger.commands)
        bench.port.command(STOP)
        wait_until(lambda: charger.commands[commands:] == [REST_STOP, OPERATION_STOP])
    charger.mute = False
    bench.wait_online()


def test_a_line_that_always_has_more_to_read_does_not_hold_up_a_stop() -> None:
    """Faster than any pty, so reading never ends."""

    class Endless:
        def __init__(self) -> None:
            self.written: list[bytes] = []

        def write(self, data: bytes) -> None:
            self.written.append(data)

        def read(self, timeout_s: float, expected: int = 0) -> bytes:
            return bytes(64)

        def restore(self) -> None:
            return None

        def locked_by(self) -> None:
            return None

        def close(self) -> None:
            pass

    line = Endless()
    with running("endless", open_line=lambda: line) as bench:
        wait_until(lambda: bench.link.misses)
        wait_until(lambda: line.written.count(REST_STOP) >= 2)
