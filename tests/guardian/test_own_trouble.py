"""What may go wrong in a process of last resort itself, or in the machine: each charger is stopped all the same."""

import errno
import os
import resource
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from orchestrator.lastresort import guardian, lastport
from orchestrator.lastresort.contactors import HANGS, Contactors
from orchestrator.lastresort.descriptors import Turns, room
from orchestrator.lastresort.guardian import ACTED, BEAT, ENDS, PORT, Guardian
from orchestrator.lastresort.lastline import ROUND_S, RUNS, SILENT
from orchestrator.lastresort.laststop import LastStop, stop_all
from orchestrator.protocol.standby import STOP_FRAME
from tests.guardian.chargers import Bench, running_chargers
from tests.guardian.watched import state_of, watched
from tests.link.ptys import plugged
from tests.link.strangers import holding, somebody_else
from tests.waiting import wait_until


def no_thread(*_: object) -> None:
    raise RuntimeError("can't start new thread")


# --- an exception of our own -----------------------------------------------------------------------------------------


def broken(*_: object) -> tuple[float, str]:
    raise ZeroDivisionError("by accident")


@pytest.mark.parametrize("turns", [0, 1])
def test_an_exception_is_told_and_keeps_nobody_from_being_stopped(tmp_path: Path, turns: int) -> None:
    with running_chargers(tmp_path, 2) as benches:
        stopping = LastStop(leave_held=False, turns=Turns(turns) if turns else None)
        stopping.witness = broken
        stopping.stop({bench.name: None for bench in benches})
        told = stopping.finish(2 * ROUND_S)
        internal = "internal: ZeroDivisionError('by accident')"
        assert internal in told.values()
        assert set(told.values()) <= {internal, *([SILENT] * turns)}, "one may have its turn just then"
        assert not any(bench.runs for bench in benches)
        assert all(bench.stops > 2 for bench in benches), "the next round begins all the same"


# --- too little of something ------------------------------------------------------------------------------------------


def test_without_any_thread_all_are_stopped_and_nothing_is_claimed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with running_chargers(tmp_path, 2) as benches:
        monkeypatch.setattr(threading.Thread, "start", no_thread)
        told = stop_all({bench.name: None for bench in benches}, ROUND_S)
        monkeypatch.undo()
        assert told == {bench.name: SILENT for bench in benches}
        assert not any(bench.runs for bench in benches)


def test_without_a_thread_a_contactor_opens_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading.Thread, "start", no_thread)
    contactors = Contactors()
    contactors.open("bay-1", lambda: "open")
    assert contactors.became == {"bay-1": "open"}


def test_a_contactor_is_opened_once_at_a_time_and_waited_for() -> None:
    contactors, goes_on, opened = Contactors(), threading.Event(), list[str]()

    def slowly() -> str:
        opened.append("bay-1")
        goes_on.wait(10)
        return "open"

    for _ in range(2):
        contactors.open("bay-1", slowly)
    began_s = time.monotonic()
    contactors.wait(0.05)
    assert 0.05 <= time.monotonic() - began_s < 5
    assert (contactors.became, opened) == ({"bay-1": HANGS}, ["bay-1"])
    goes_on.set()
    contactors.wait(5)
    assert contactors.became == {"bay-1": "open"}
    assert time.monotonic() - began_s < 5  # it ends with the answer, not with the time

    def opens_again() -> bool:
        contactors.open("bay-1", lambda: "open again")
        return contactors.became == {"bay-1": "open again"}

    wait_until(opens_again)


@pytest.mark.parametrize("error", [PermissionError(errno.EPERM, "no"), ValueError("not allowed to raise it")])
def test_a_limit_that_may_not_be_raised_is_lived_with(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """As after the kernel's own limit (fs.nr_open) was lowered."""

    def refuses(*_: object) -> None:
        raise error

    limit = 200
    monkeypatch.setattr(os, "sysconf", {"SC_OPEN_MAX": limit}.__getitem__)
    monkeypatch.setattr(resource, "setrlimit", refuses)
    assert 0 < room() < limit


def test_where_ports_take_turns_one_that_goes_on_keeps_no_other_from_its_turn(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 3) as (deaf, *good):
        deaf.charger.ignores_stop = True
        stopping = LastStop(leave_held=False, turns=Turns(1))
        stopping.stop({bench.name: None for bench in (deaf, *good)})
        told = stopping.finish(3 * ROUND_S)
        assert told.pop(deaf.name) in (RUNS, SILENT)  # a turn that has just begun has not heard it yet
        assert told == {bench.name: "" for bench in good}
        assert deaf.stops > 3


# --- drivers and others -----------------------------------------------------------------------------------------------


def test_a_driver_that_refuses_the_settings_gets_the_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They may be right all the same, or nearly."""
    refused = []

    def refuses(fd: int, *_: Any) -> None:
        refused.append(fd)
        raise termios.error(errno.EINVAL, "Invalid argument")

    with plugged(tmp_path / "port") as pty:
        monkeypatch.setattr(termios, "tcsetattr", refuses)
        assert stop_all({pty.path: None}, 0.1) == {pty.path: SILENT}
        assert refused
        assert pty.drain().startswith(STOP_FRAME)


@contextmanager
def reading_all(port: str) -> Iterator[None]:
    """A program that takes whatever comes in, at once."""
    fd, over = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), threading.Event()

    def read() -> None:
        while not over.is_set():
            try:
                os.read(fd, 4096)
            except BlockingIOError:
                over.wait(0.001)

    reader = threading.Thread(target=read)
    reader.start()
    try:
        yield
    finally:
        over.set()
        reader.join()
        os.close(fd)


def test_answers_that_another_program_takes_are_silence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The line itself is well: who says that it is gone sends people to the adapter."""
    monkeypatch.setattr(lastport, "GATHER_S", 0.1)  # the other one is quicker, on a busy machine, too
    with running_chargers(tmp_path) as (bench,), reading_all(bench.name):
        assert stop_all({bench.name: None}, ROUND_S) == {bench.name: SILENT}
        assert bench.wire.counters.polls
        assert not bench.runs


def test_a_port_that_one_program_has_for_itself_alone_is_told_with_who_it_is(tmp_path: Path) -> None:
    with plugged(tmp_path / "port") as pty:
        device = os.path.realpath(pty.path)
        Path(device).chmod(0o666)
        with holding(device, "TIOCEXCL"), somebody_else():
            told = stop_all({device: None}, 0.1)[device]
        assert told.startswith("one program has this port for itself alone (TIOCEXCL): ")
        assert pty.drain() == b""


@pytest.mark.parametrize("lost", [Bench.unplug, lambda bench: setattr(bench.wire, "mute_tx", True)])
def test_a_proof_stands_when_the_line_is_lost_afterwards(tmp_path: Path, lost: Any) -> None:
    with running_chargers(tmp_path) as (bench,):

        def lose() -> None:
            if bench.wire.counters.polls >= 3:  # it was asked again, so two answers have shown standby
                lost(bench)

        assert stop_all({bench.name: None}, 5.0, watch_s=4 * ROUND_S, on_round=lose) == {bench.name: ""}


# --- the guardian's connection ----------------------------------------------------------------------------------------


class Torn(socket.socket):
    """A connection that the kernel has only errors for after the first message."""

    taken = False

    def recvmsg(self, *size: Any) -> Any:
        if self.taken:
            raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
        self.taken = True
        return super().recvmsg(*size)


@pytest.fixture
def _signals() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in ENDS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("_signals")
def test_a_connection_that_fails_is_one_that_has_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guardian, "VERIFY_S", 1.0)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    torn = Torn(fileno=theirs.detach())
    with running_chargers(tmp_path) as (bench,), ours, torn:
        child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
        ours.send(PORT + bench.name.encode())
        ours.send(BEAT)
        assert Guardian(child.pid, torn).run() == ACTED
        assert child.wait() == -signal.SIGKILL
        assert not bench.runs


def test_a_descriptor_that_belongs_to_no_message_is_closed(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    with watched(tmp_path, "SILENCE_S=20", "END_S=0.1") as watching:
        watching.beat()
        before = watching.files
        for _ in range(3):
            watching.send(BEAT, writer)
            watching.link.recv(16)
        watching.beat()
        assert watching.files == before
        watching.link.close()
        assert watching.ended() == ACTED
    os.close(reader)
    os.close(writer)


@pytest.mark.usefixtures("_signals")
def test_what_it_was_started_to_ignore_it_ignores(tmp_path: Path) -> None:
    """`nohup`, or a job in the background of a shell: but not SIGTERM."""
    ignored = set(ENDS) - {signal.SIGTERM}
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)
    with watched(tmp_path, "SILENCE_S=20", "END_S=0.1") as watching:
        watching.beat()
        for number in ignored:
            watching.process.send_signal(number)
        watching.beat()
        wait_until(lambda: state_of(watching.controller) == "S", what="a controller that goes on")
        watching.process.send_signal(signal.SIGTERM)
        watching.link.close()
        assert watching.ended() == 0, "it was told to end, and held no port"
