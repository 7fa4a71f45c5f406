"""The controller's messages to the guardian, and what it does with the ports they name."""

import fcntl
import os
import socket
import termios
import time
from contextlib import suppress
from pathlib import Path

import pytest

from orchestrator.lastresort.guardian import ACTED, ALIVE, BEAT, DROP
from tests.devices.fake_charger import charger_on
from tests.guardian.chargers import running_chargers
from tests.guardian.watched import END_S, Watched, watched
from tests.link.ptys import plugged
from tests.link.strangers import holding, stty
from tests.waiting import wait_until


def test_ports_that_come_and_go_leave_nothing_behind(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 2) as benches, watched(tmp_path) as guardian:
        guardian.beat()
        before = guardian.files
        for turn in range(1000):
            bench = benches[turn % 2]
            guardian.hand_over(bench.name, bench.fd)
            if turn % 3:  # otherwise it is handed over again without having been dropped
                guardian.send(DROP + bench.name.encode())
            if turn % 100 == 0:
                guardian.beat()
        for bench in benches:
            guardian.send(DROP + bench.name.encode())
        guardian.beat()
        wait_until(lambda: guardian.files == before, what="the end of all that was given up")


def test_a_port_that_is_dropped_is_free(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        held = bench.duplicate()
        fcntl.flock(held, fcntl.LOCK_EX)
        guardian.hand_over(bench.name, held)
        guardian.beat()
        os.close(held)
        os.close(bench.fd)
        bench.fd = os.open(bench.name, os.O_RDWR | os.O_NOCTTY)
        with pytest.raises(BlockingIOError):
            fcntl.flock(bench.fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        guardian.send(DROP + bench.name.encode())
        guardian.beat()
        wait_until(lambda: locked(bench.fd), what="the lock")


def locked(fd: int) -> bool:
    with suppress(BlockingIOError):
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def test_a_port_whose_close_hangs_keeps_nobody_from_watching(tmp_path: Path) -> None:
    """Nor when the others have to be stopped in the end."""
    with running_chargers(tmp_path, 2) as (stuck, good), watched(tmp_path, hangs={"close": stuck.name}) as guardian:
        for bench in (stuck, good):
            guardian.hand_over(bench.name, bench.fd)
        guardian.send(DROP + stuck.name.encode())
        end_s = time.monotonic() + 1.5
        while time.monotonic() < end_s:
            guardian.beat()
        assert guardian.process.poll() is None
        dies_s = time.monotonic()
        guardian.link.close()
        assert guardian.ended() == ACTED
        stop_s = good.wire.counters.first_stop_s
        assert stop_s is not None
        assert stop_s - dies_s < 0.2
        assert not stuck.runs, "it was opened anew"


#: Each hangs on a port of its own.
CALLS = ("open", "write", "isatty", "tcsetattr", "close")


@pytest.mark.parametrize("is_open", [True, False])
def test_a_driver_that_hangs_delays_no_other_charger_and_not_the_end(tmp_path: Path, *, is_open: bool) -> None:
    with running_chargers(tmp_path, len(CALLS) + 2) as benches:
        stuck, good = benches[: len(CALLS)], benches[len(CALLS) :]
        hangs = {call: bench.name for call, bench in zip(CALLS, stuck, strict=True)}
        with watched(tmp_path, hangs=hangs) as guardian:
            for bench in benches:
                guardian.hand_over(bench.name, bench.fd)
                if not is_open and bench.name != hangs["close"]:
                    guardian.send(DROP + bench.name.encode())
            guardian.beat()
            dies_s = time.monotonic()
            guardian.link.close()
            assert guardian.ended() == ACTED
            assert time.monotonic() - dies_s < 4.0
            for bench in good:
                stop_s = bench.wire.counters.first_stop_s
                assert stop_s is not None
                assert stop_s - dies_s < 0.2
                assert f"guardian: {bench.name}: standby verified" in guardian.log


def test_a_port_that_was_closed_when_the_controller_died_is_stopped_all_the_same(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 2) as (closed, sent_in_vain), watched(tmp_path) as guardian:
        guardian.hand_over(closed.name, closed.fd)
        guardian.send(DROP + closed.name.encode())
        guardian.hand_over(sent_in_vain.name)  # as the kernel delivers it when the guardian has no descriptors left
        guardian.beat()
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert not closed.runs
        assert not sent_in_vain.runs


def test_a_port_that_another_service_has_taken_is_left_to_it(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, "VERIFY_S=0.1") as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(DROP + bench.name.encode())
        guardian.beat()
        with holding(bench.name, name="orchestrator"):
            guardian.link.close()
            assert guardian.ended() == ACTED
        assert bench.stops == 0
        assert "CUT THE MAINS" not in guardian.log


def test_a_port_that_a_stranger_has_locked_meanwhile_is_stopped(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(DROP + bench.name.encode())
        guardian.beat()
        with holding(bench.name):
            guardian.link.close()
            assert guardian.ended() == ACTED
        assert not bench.runs


def test_a_port_that_was_set_to_another_speed_is_stopped(tmp_path: Path) -> None:
    with plugged(tmp_path / "port") as pty, charger_on(pty) as charger, watched(tmp_path) as guardian:
        charger.baud, charger.running = termios.B19200, 1
        port = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
        guardian.hand_over(pty.path, port)
        guardian.beat()
        os.close(port)
        stty(pty.path, "115200")
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert not charger.running
        assert f"guardian: {pty.path}: standby verified" in guardian.log


def test_strange_messages_are_no_harm(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.beat()
        before = guardian.files
        for message in (b"X", b"\xff" * 4000, DROP + b"never-heard-of", DROP + b"\xff\xfe"):
            guardian.send(message, bench.fd)
        guardian.beat()
        assert guardian.files == before


def test_a_controller_that_reads_no_answers_holds_nothing_up(tmp_path: Path) -> None:
    with watched(tmp_path) as guardian:
        for _ in range(1000):  # far more than fits into the socket
            guardian.send(BEAT)
        guardian.settle()
        guardian.link.setblocking(False)
        with suppress(BlockingIOError):
            while True:
                assert guardian.link.recv(16) == ALIVE
        guardian.link.settimeout(END_S)
        guardian.beat()


def test_the_last_words_of_a_controller_that_died_are_heard(tmp_path: Path) -> None:
    """It died with unread answers: the kernel first reports "connection reset", then delivers its messages."""
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.beat()
        guardian.send(BEAT)
        assert guardian.link.recv(16, socket.MSG_PEEK) == ALIVE
        guardian.freeze()
        guardian.hand_over(bench.name, bench.fd)
        guardian.link.close()
        guardian.thaw()
        assert guardian.ended() == ACTED
        assert not bench.runs


def sleep_through(guardian: Watched, seconds: float) -> None:
    """The guardian is suspended for that long."""
    guardian.freeze()
    slept_s = time.monotonic()
    wait_until(lambda: time.monotonic() > slept_s + seconds)


def test_a_guardian_that_slept_looks_at_its_messages_before_it_judges(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        sleep_through(guardian, 0.7)
        guardian.send(BEAT)
        guardian.thaw()
        assert guardian.link.recv(16) == ALIVE
        guardian.beat()
        assert bench.stops == 0


def test_a_machine_that_stood_still_is_no_hang_once(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        for _ in range(2):  # each heartbeat extends the deadline
            guardian.beat()
            sleep_through(guardian, 0.7)
            guardian.thaw()
            guardian.settle()
        assert bench.stops == 0
        guardian.beat()
        sleep_through(guardian, 0.7)
        guardian.thaw()
        guardian.settle()
        sleep_through(guardian, 0.7)
        guardian.thaw()
        assert guardian.ended() == ACTED
        assert not bench.runs
