"""Who may end the guardian, and who is told: signals, terminals, logs, systemd."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from orchestrator.lastresort.guardian import ACTED, DONE
from tests.guardian.chargers import running_chargers
from tests.guardian.watched import END_S, ENDS_WITH_4_WHEN_TOLD, SAYS_WHEN_HUNG_UP, state_of, watched
from tests.waiting import wait_until


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGQUIT])
def test_whoever_wants_it_to_end_ends_the_controller_first(tmp_path: Path, number: signal.Signals) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, controller=ENDS_WITH_4_WHEN_TOLD) as guardian:
        guardian.waits_for("\n")  # the controller is ready for the signal
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(DONE)
        guardian.settle()
        guardian.process.send_signal(number)
        wait_until(lambda: state_of(guardian.controller) == "Z")
        guardian.link.close()
        assert guardian.ended() == 4


def test_a_hang_up_without_a_terminal_is_passed_on_and_ends_nothing(tmp_path: Path) -> None:
    with watched(tmp_path, "SILENCE_S=20", "END_S=0.1", controller=SAYS_WHEN_HUNG_UP) as guardian:
        guardian.waits_for("\n")
        guardian.process.send_signal(signal.SIGHUP)  # too early: it reads everything again anyway
        guardian.beat()
        guardian.beat()  # the first one has been handled
        guardian.process.send_signal(signal.SIGHUP)
        guardian.waits_for("hung up")
        guardian.beat()
        assert guardian.log.count("hung up") == 1
        guardian.link.close()
        guardian.ended()


def test_a_terminal_that_is_closed_ends_what_was_started_from_it(tmp_path: Path) -> None:
    master, slave = os.openpty()
    with watched(tmp_path, controller=ENDS_WITH_4_WHEN_TOLD, terminal=slave) as guardian:
        guardian.waits_for("\n")
        guardian.send(DONE)
        guardian.process.send_signal(signal.SIGHUP)
        wait_until(lambda: state_of(guardian.controller) == "Z")
        guardian.link.close()
        assert guardian.ended() == 4
    os.close(master)
    os.close(slave)


def test_an_end_before_anything_has_begun_is_a_good_one(tmp_path: Path) -> None:
    with watched(tmp_path) as guardian:
        guardian.beat()
        guardian.process.send_signal(signal.SIGTERM)
        wait_until(lambda: state_of(guardian.controller) == "Z")
        guardian.link.close()
        assert guardian.ended() == 0


def stops_whatever_its_log_does(tmp_path: Path, log: int) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, stderr=log) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert not bench.runs


def test_a_log_that_nobody_reads_does_not_hold_a_stop_up(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    os.set_blocking(writer, True)
    stops_whatever_its_log_does(tmp_path, writer)
    os.close(reader)
    os.close(writer)


def test_a_log_that_is_gone_does_not_hold_a_stop_up(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    stops_whatever_its_log_does(tmp_path, writer)
    os.close(writer)


@contextmanager
def systemd(directory: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(directory / "notify"))
        manager.settimeout(END_S)
        yield manager


def heard(manager: socket.socket) -> list[str]:
    """All notifications not read yet."""
    said = []
    manager.setblocking(False)
    with suppress(BlockingIOError):
        while True:
            said.append(manager.recv(4096).decode())
    manager.settimeout(END_S)
    return said


def test_systemd_hears_that_it_is_ready_that_it_lives_and_what_it_does(tmp_path: Path) -> None:
    with systemd(tmp_path) as manager, running_chargers(tmp_path) as (bench,):
        with watched(tmp_path, "WATCHDOG_S=60", "VERIFY_S=0.4", notify=str(tmp_path / "notify")) as guardian:
            guardian.hand_over(bench.name, bench.fd)
            for _ in range(5):
                guardian.beat()
            assert heard(manager) == ["READY=1", "WATCHDOG=1"]  # not with every heartbeat
            guardian.process.send_signal(signal.SIGTERM)
            assert manager.recv(99) == b"STOPPING=1"
            guardian.link.close()
            assert guardian.ended() == ACTED
        assert heard(manager) == [
            "WATCHDOG=1",
            "STATUS=the controller was ended by SIGTERM; stopping the chargers",
        ]


def test_a_watchdog_is_fed_while_the_controller_beats(tmp_path: Path) -> None:
    with systemd(tmp_path) as manager, watched(tmp_path, "WATCHDOG_S=0", notify=str(tmp_path / "notify")) as guardian:
        for _ in range(3):
            guardian.beat()
        ready, *fed = heard(manager)
        assert ready == "READY=1"
        assert set(fed) == {"WATCHDOG=1"}
        assert len(fed) >= 2  # the last one may still be on its way, and one more may be sent meanwhile


def test_a_watchdog_is_fed_for_as_long_as_chargers_are_being_stopped(tmp_path: Path) -> None:
    with systemd(tmp_path) as manager, running_chargers(tmp_path) as (bench,):
        bench.charger.ignores_stop = True
        with watched(tmp_path, "VERIFY_S=1.2", notify=str(tmp_path / "notify")) as guardian:
            guardian.hand_over(bench.name, bench.fd)
            guardian.beat()
            guardian.link.close()
            assert guardian.ended() == ACTED
        assert heard(manager).count("WATCHDOG=1") >= 4


def test_a_systemd_that_does_not_listen_holds_nothing_up(tmp_path: Path) -> None:
    with systemd(tmp_path), running_chargers(tmp_path) as (bench,):
        with watched(tmp_path, "WATCHDOG_S=0", notify=str(tmp_path / "notify")) as guardian:
            guardian.hand_over(bench.name, bench.fd)
            for _ in range(2000):  # far more than fits into the socket
                guardian.beat()
            guardian.link.close()
            assert guardian.ended() == ACTED
        assert not bench.runs
