"""The stop of last resort on emulated chargers: its writes, the answers it believes, and its waiting."""

import fcntl
import os
import socket
import sys
import termios
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from orchestrator.errors import LinkError
from orchestrator.lastresort import laststop
from orchestrator.lastresort.bareport import HELD, drop_port, open_port
from orchestrator.lastresort.guardian import VERIFY_S
from orchestrator.lastresort.lastline import (
    ASK_S,
    HANGS,
    ONCE,
    ROUND_S,
    RUNS,
    SILENT,
    STOPS,
)
from orchestrator.lastresort.lastport import GONE, STALLED
from orchestrator.lastresort.laststop import LastStop, stop_all
from orchestrator.link.serial import SerialLine
from orchestrator.model import Action, Command
from orchestrator.protocol.charger import STATUS_REQUEST, encode
from orchestrator.protocol.standby import OPERATION_STOP_FRAME, QUESTION, STOP_FRAME
from orchestrator.sim.charger_frames import Kind, Lie
from tests.core.said import raises, say
from tests.devices.fake_charger import charger_on
from tests.guardian.chargers import running_chargers
from tests.link.ptys import plugged
from tests.link.strangers import holding, stty
from tests.waiting import wait_until

#: Every frame a dying controller may have been writing.
FRAMES = (
    STATUS_REQUEST,
    encode(Command(Action.RUN)),
    encode(Command(Action.RESUME)),
    encode(Command(Action.STOP)),
    *(encode(Command(Action.SET_LIMIT, value)) for value in range(5)),
)


def test_every_charger_is_stopped_and_verified(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 8) as benches:
        assert stop_all({bench.name: bench.duplicate() for bench in benches}, 3.0) == {b.name: "" for b in benches}
        assert not any(bench.runs or bench.charger.run for bench in benches)


def test_a_round_ends_when_its_chargers_have_had_time_to_obey(tmp_path: Path) -> None:
    """Contactors opened at its end break no current where the stop was obeyed; elsewhere nothing waits."""
    with running_chargers(tmp_path, 2) as (good, deaf):
        deaf.charger.ignores_stop = True
        seen: list[tuple[bool, bool]] = []
        began_s = time.monotonic()
        rounds_s: list[float] = []

        def look() -> None:
            seen.append((good.runs, deaf.runs))
            rounds_s.append(time.monotonic() - began_s)

        stop_all({good.name: None, deaf.name: None}, 3 * ROUND_S, on_round=look)
        assert set(seen) == {(False, True)}
        assert len(seen) >= 2
        assert rounds_s[0] < 2 * ROUND_S


def test_every_frame_has_its_time(tmp_path: Path) -> None:
    """They follow each other on the wire, and a charger has time to obey before the poll."""
    frames = ((STOP_FRAME, 0.0), (STOP_FRAME, 0.02), (OPERATION_STOP_FRAME, 0.04), (QUESTION, ASK_S))
    with plugged(tmp_path / "port") as pty:
        began_s = time.monotonic()
        stopping = threading.Thread(target=stop_all, args=({pty.path: None}, ROUND_S + 0.1))
        stopping.start()
        for round_s in (0.0, ROUND_S):
            for frame, at_s in frames:
                assert os.read(pty.master, len(frame)) == frame
                assert time.monotonic() - began_s >= round_s + at_s
        stopping.join()


def test_a_port_is_opened_by_its_name(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        assert stop_all({bench.name: None}, 3.0) == {bench.name: ""}
        assert not bench.runs


def test_a_name_that_no_file_can_have_keeps_no_other_charger_running(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        nameless = "not the name of a port"
        assert stop_all({"a\0b": None, bench.name: None, "\ud800": None}, 1.0) == {
            "a\0b": nameless, bench.name: "", "\ud800": nameless,
        }  # fmt: skip
        assert not bench.runs


@pytest.mark.parametrize("line", ["echo", "garbage", "delayed", "bytewise", "lossy"])
def test_on_every_kind_of_line(tmp_path: Path, line: str) -> None:
    with running_chargers(tmp_path, line=line) as (bench,):
        assert stop_all({bench.name: None}, 5.0) == {bench.name: ""}
        assert not bench.runs


#: The bytes of one round.
ROUND = b"".join(frame for _, frame in STOPS) + QUESTION


@pytest.mark.parametrize(("longest", "rounds"), [(38, 1), (262, 10)])
def test_half_a_frame_does_not_spoil_the_stop(longest: int, rounds: int) -> None:
    """Whatever partial frame a charger's decoder holds, it understands one of the two stops.

    A decoder that believes any length swallows up to 256 bytes; the rounds go on for longer than that.
    """
    assert VERIFY_S / ROUND_S >= 10
    for frame in FRAMES:
        for cut in range(1, len(frame)):
            heard = naive_decoder(frame[:cut] + rounds * ROUND, longest)
            assert STOP_FRAME in heard, (frame.hex(" "), cut)
            assert encode(Command(Action.RUN)) not in heard, (frame.hex(" "), cut)


def naive_decoder(stream: bytes, longest: int) -> list[bytes]:
    """The good frames found by a decoder that discards a bad frame together with the frames it swallowed."""
    good, at = [], 0
    while (at := stream.find(b"\xaf\xfa", at)) >= 0 and at + 4 <= len(stream):
        size = stream[at + 3] + 6
        frame = stream[at : at + size]
        if size > longest:
            size = 4
        elif len(frame) == size and frame[-2:] == b"\xaf\xa0" and frame[-3] == sum(frame[2:-3]) % 256:
            good.append(frame)
        at += size
    return good


def test_half_a_frame_on_the_wire(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        os.write(bench.fd, FRAMES[0][:5])
        assert stop_all({bench.name: bench.duplicate()}, 3.0) == {bench.name: ""}


def test_an_answer_from_before_the_question_proves_nothing(tmp_path: Path) -> None:
    """The dying controller's last answers lie unread in the port and claim that all is well."""
    with running_chargers(tmp_path) as (bench,):
        bench.wire.lies[Kind.OPERATION] = 0
        os.write(bench.fd, STATUS_REQUEST + QUESTION)
        wait_until(lambda: bench.wire.counters.polls == 2)
        wait_until(lambda: waiting(bench.fd) >= 40)
        bench.wire.lies.clear()
        bench.charger.ignores_stop = True
        assert stop_all({bench.name: bench.duplicate()}, 0.6) == {bench.name: RUNS}


def waiting(fd: int) -> int:
    """Received bytes not yet read."""
    answer = bytearray(4)
    fcntl.ioctl(fd, 0x541B, answer)  # FIONREAD
    return int.from_bytes(answer, "little")


def test_a_charger_that_goes_on_is_told_from_a_silent_one(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 2) as (deaf, mute):
        deaf.charger.ignores_stop = True
        mute.wire.mute_tx = True
        told = stop_all({deaf.name: deaf.duplicate(), mute.name: mute.duplicate()}, 1.2)
        assert told == {deaf.name: RUNS, mute.name: SILENT}
        assert not mute.runs  # it heard
        assert deaf.stops >= 6  # in each of three rounds, twice


def test_a_late_obedience_is_waited_for(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        bench.charger.ignores_stop = True
        later = threading.Timer(0.8, setattr, (bench.charger, "ignores_stop", False))
        later.start()
        assert stop_all({bench.name: bench.duplicate()}, 5.0) == {bench.name: ""}


def test_a_line_that_takes_nothing_is_not_waited_for(tmp_path: Path) -> None:
    """Unsent output is dropped: a command from before the stop must not go out minutes later."""
    with plugged(tmp_path / "stalled") as pty, running_chargers(tmp_path) as (bench,):
        filled = pty.fill()
        began_s = time.monotonic()
        adopted = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
        told = stop_all({pty.path: adopted, bench.name: bench.duplicate()}, 0.6)
        assert told[bench.name] == ""
        assert told[pty.path] in (STALLED, SILENT)
        assert time.monotonic() - began_s < 3.0
        came = pty.drain()
        assert len(came) < filled
        assert came.endswith(STOP_FRAME * 2 + OPERATION_STOP_FRAME + QUESTION)


def test_a_line_that_takes_nothing_at_all_says_so() -> None:
    """A flushed tty accepts output again if its driver is alive."""
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    with theirs:
        with suppress(BlockingIOError):
            while True:
                ours.send(bytes(4096))
        assert stop_all({"/nowhere": ours.detach()}, 0.1) == {"/nowhere": STALLED}


def test_a_port_that_fails_is_opened_anew(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        held = bench.duplicate()
        bench.unplug()
        os.close(bench.fd)
        plug = threading.Timer(0.7, bench.plug)
        plug.start()
        assert stop_all({bench.name: held}, 5.0) == {bench.name: ""}
        plug.join()
        assert not bench.runs


def test_a_line_that_ends_says_so() -> None:
    """A tty after a hangup reads end of file, and may still accept writes."""
    ours, theirs = socket.socketpair()
    with theirs:
        theirs.shutdown(socket.SHUT_WR)
        assert stop_all({"/nowhere": ours.detach()}, 0.1) == {"/nowhere": GONE}


def test_an_open_port_keeps_nobody_waiting(tmp_path: Path) -> None:
    with plugged(tmp_path / "port") as pty:
        fd = open_port(pty.path, leave_held=False)
        assert not os.get_blocking(fd)
        os.close(fd)


def test_a_port_that_is_dropped_does_not_send_the_rest(tmp_path: Path) -> None:
    with plugged(tmp_path / "port") as pty:
        fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        filled = pty.fill()
        drop_port(fd)
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(fd)
        assert len(pty.drain()) < filled, "what the other end has not taken yet is lost"


def test_a_port_that_is_not_there_says_so(tmp_path: Path) -> None:
    assert stop_all({str(tmp_path / "none"): None}, 0.1) == {str(tmp_path / "none"): "No such file or directory"}
    assert stop_all({}, 5.0) == {}


def test_no_descriptor_is_left_open(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        before = set(Path("/proc/self/fd").iterdir())
        stop_all({bench.name: bench.duplicate(), str(tmp_path / "none"): None}, 0.1)
        stop_all({bench.name: None}, 0.1)
        assert set(Path("/proc/self/fd").iterdir()) <= before  # others may have been closed as garbage meanwhile


def test_a_file_that_is_no_port_is_not_written_to(tmp_path: Path) -> None:
    file = tmp_path / "station.yaml"
    file.write_text("station: depot-1\n")
    assert stop_all({str(file): None}, 0.1, leave_held=False) == {str(file): "not a serial port"}
    assert file.read_text() == "station: depot-1\n"


def test_two_who_stop_the_same_charger_both_get_their_proof(tmp_path: Path) -> None:
    """The guardian and an `estop`, for example: each answer goes entirely to one of them."""
    with running_chargers(tmp_path) as (bench,):
        told: list[dict[str, str]] = []
        both = [
            threading.Thread(target=lambda: told.append(stop_all({bench.name: None}, 5.0, leave_held=False)))
            for _ in range(2)
        ]
        for one in both:
            one.start()
        for one in both:
            one.join()
        assert told == [{bench.name: ""}] * 2


def test_what_another_process_reads_is_not_read_here(tmp_path: Path) -> None:
    """This also takes two samples."""
    asked: list[float] = []

    def witness(name: str, since_s: float) -> tuple[float, str]:
        asked.append(since_s)
        assert name == bench.name
        return (0.0, "not yet") if len(asked) <= 2 else (1.0, "") if len(asked) <= 4 else (2.0, "")

    with running_chargers(tmp_path) as (bench,):
        stopping = LastStop()
        stopping.witness = witness
        began_s = time.monotonic()
        stopping.stop({bench.name: bench.duplicate()})
        assert stopping.finish(5.0) == {bench.name: ""}
        assert len(asked) == 5
        assert bench.wire.counters.polls == 0
        assert len(set(asked)) == 1  # the first stops count
        assert asked[0] > began_s


def test_what_another_process_doubts_is_no_proof(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        stopping = LastStop()
        stopping.witness = lambda *_: (1.0, "no")
        stopping.stop({bench.name: None})
        assert stopping.finish(0.6) == {bench.name: "no"}


def test_the_first_stop_is_out_when_it_returns(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        stopping = LastStop(leave_held=False)
        stopping.stop({bench.name: None})
        wait_until(lambda: bench.stops >= 1)
        assert not bench.runs
        assert stopping.finish(3.0) == {bench.name: ""}


def test_it_goes_on_without_a_thread_to_be_had(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped by the threads there are, and verified once threads can start again."""

    def none_left(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    with running_chargers(tmp_path, 2) as benches, monkeypatch.context() as patch:
        stopping = LastStop()
        patch.setattr(threading.Thread, "start", none_left)
        stopping.stop({bench.name: None for bench in benches})
        wait_until(lambda: not any(bench.runs for bench in benches))
        patch.undo()
        assert stopping.finish(3.0) == {bench.name: "" for bench in benches}


# --- one port never delays another -----------------------------------------------------------------------------------


@contextmanager
def hanging(patch: pytest.MonkeyPatch, module: Any, call: str, port: str) -> Iterator[None]:
    """This system call never returns for this port, as with an adapter with dead firmware."""
    goes_on, good = threading.Event(), getattr(module, call)
    device = os.path.realpath(port)

    def hangs(which: Any, *rest: Any) -> Any:
        name = which if isinstance(which, str) else str(Path(f"/proc/self/fd/{which}").readlink())
        if os.path.realpath(name) == device:
            goes_on.wait(30)
        return good(which, *rest)

    with patch.context() as patched:
        patched.setattr(module, call, hangs)
        try:
            yield
        finally:
            goes_on.set()


#: Every call that a stop makes to a port's driver.
CALLS = (
    (os, "open"), (os, "write"), (os, "close"), (os, "isatty"), (os, "set_blocking"), (termios, "tcsetattr"),
    (termios, "tcgetattr"), (termios, "tcflush"), (termios, "tcflow"), (fcntl, "ioctl"), (fcntl, "flock"),
)  # fmt: skip


@dataclass(frozen=True)
class Hung:
    """A stop of one port for each of CALLS, which hangs in that call, between two good ones."""

    took_s: float
    told: Mapping[str, str]  #: of those that hang, by call
    good: Mapping[str, str]
    stops_s: Sequence[float | None]  #: of the good ones, from the beginning


@pytest.fixture(scope="module", params=[True, False], ids=["opened", "not opened"])
def hung(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Hung:
    patch, directory = pytest.MonkeyPatch(), tmp_path_factory.mktemp("hung")
    with running_chargers(directory, len(CALLS) + 2) as benches, ExitStack() as stack:
        first, *bad, last = benches
        for (module, call), bench in zip(CALLS, bad, strict=True):
            stack.enter_context(hanging(patch, module, call, bench.name))
        ports = {bench.name: bench.duplicate() if request.param else None for bench in benches}
        began_s = time.monotonic()
        told = stop_all(ports, 3 * ROUND_S)
        took_s = time.monotonic() - began_s
        stops_s = [bench.wire.counters.first_stop_s for bench in (first, last)]
        return Hung(
            took_s,
            {call: told[bench.name] for (_, call), bench in zip(CALLS, bad, strict=True)},
            {bench.name: told[bench.name] for bench in (first, last)},
            [at_s and at_s - began_s for at_s in stops_s],
        )


@pytest.mark.parametrize("call", [call for _, call in CALLS])
def test_a_driver_that_hangs_delays_no_other_port(hung: Hung, call: str) -> None:
    """In any call, with the port open or not, and at any place in the list."""
    assert hung.took_s < 3 * ROUND_S + laststop.CLOSE_S + 0.3
    assert set(hung.good.values()) == {""}
    for stop_s in hung.stops_s:
        assert stop_s is not None
        assert stop_s < ROUND_S - 0.1
    assert hung.told[call] in ("", HANGS, SILENT)


def test_a_hundred_ports_are_stopped_at_once(tmp_path: Path) -> None:
    with ExitStack() as stack:
        ptys = [stack.enter_context(plugged(tmp_path / str(number))) for number in range(128)]
        stopping = LastStop()
        stopping.stop({pty.path: os.open(pty.path, os.O_RDWR | os.O_NOCTTY) for pty in ptys})
        assert all(pty.drain().startswith(STOP_FRAME) for pty in ptys)
        took_s = max(line._stopped_s for line in stopping._lines.values()) - stopping._began_s
        assert took_s < 0.1  # 2 ms on an idle machine
        stopping.finish(0.1)


@pytest.mark.parametrize("stuck", [1, 2, 10, 127])
def test_however_many_hang_the_others_are_stopped(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, stuck: int) -> None:
    with ExitStack() as stack:
        ptys = [stack.enter_context(plugged(tmp_path / str(number))) for number in range(128)]
        descriptors = {pty.path: os.open(pty.path, os.O_RDWR | os.O_NOCTTY) for pty in ptys}
        hang, goes_on, good = set(list(descriptors.values())[:stuck]), threading.Event(), os.write

        def writes(fd: int, data: bytes) -> int:
            if fd in hang:
                goes_on.wait(30)
            return good(fd, data)

        monkeypatch.setattr(os, "write", writes)
        stopping = LastStop()
        stopping.stop(descriptors)
        wait_until(lambda: sum(line.tried.is_set() for line in stopping._lines.values()) == len(ptys) - stuck)
        took_s = max(line._stopped_s for line in stopping._lines.values()) - stopping._began_s
        assert took_s < 0.5  # the machine's load matters here: 8 ms with one hanging port, 35 ms with 64
        assert all(pty.drain().startswith(STOP_FRAME) for pty in ptys[stuck:])
        goes_on.set()
        stopping.finish(0.1)


# --- whose settings the port has -------------------------------------------------------------------------------------


@pytest.mark.parametrize("opened", [True, False])
def test_a_port_that_was_set_to_another_speed_is_stopped(tmp_path: Path, *, opened: bool) -> None:
    with plugged(tmp_path / "port") as pty, charger_on(pty) as charger:
        charger.baud, charger.running = termios.B19200, 1
        fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY) if opened else None
        stty(pty.path, "115200", "echo", "icanon")
        assert stop_all({pty.path: fd}, 3.0, watch_s=0.0) == {pty.path: ""}
        assert not charger.running


@pytest.mark.parametrize("opened", [True, False])
def test_a_port_that_was_left_without_a_line_discipline_is_stopped(tmp_path: Path, *, opened: bool) -> None:
    """With N_NULL a serial port does not even identify as one."""
    with running_chargers(tmp_path) as (bench,):
        fd = bench.duplicate() if opened else None
        without_discipline(bench.fd)
        assert stop_all({bench.name: fd}, 3.0) == {bench.name: ""}
        assert not bench.runs


@pytest.mark.parametrize("opened", [True, False])
def test_a_service_gets_on_without_a_line_discipline(tmp_path: Path, *, opened: bool) -> None:
    with running_chargers(tmp_path) as (bench,):
        line = SerialLine.open(bench.name) if opened else None
        without_discipline(bench.fd)
        line = line or SerialLine.open(bench.name)
        assert say(line.restore()) == ("line discipline 27" if opened else "")
        line.write(STOP_FRAME)
        wait_until(lambda: not bench.runs)
        line.close()


def test_what_is_no_serial_port_has_no_line_discipline() -> None:
    assert stop_all({os.devnull: None}, 0.1) == {os.devnull: "not a serial port"}
    with raises(LinkError, match="it is no serial port"):
        SerialLine.open(os.devnull)


def without_discipline(fd: int) -> None:
    """As another program may leave it."""
    try:
        fcntl.ioctl(fd, termios.TIOCSETD, (27).to_bytes(4, sys.byteorder))  # N_NULL
    except OSError:
        pytest.skip("this kernel has no N_NULL")


@pytest.mark.parametrize("opened", [True, False])
def test_output_that_was_suspended_goes_on(tmp_path: Path, *, opened: bool) -> None:
    """As after Ctrl-S, or an XOFF received while flow control was on."""
    with running_chargers(tmp_path) as (bench,):
        termios.tcflow(bench.fd, termios.TCOOFF)
        assert stop_all({bench.name: bench.duplicate() if opened else None}, 3.0) == {bench.name: ""}


def test_settings_that_hang_do_not_keep_the_first_stop_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with plugged(tmp_path / "port") as pty, hanging(monkeypatch, termios, "tcsetattr", pty.path):
        fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
        stty(pty.path, "115200")
        assert stop_all({pty.path: fd}, 0.1) == {pty.path: HANGS}
        assert pty.drain() == STOP_FRAME


# --- what is believed ------------------------------------------------------------------------------------------------


def test_one_answer_in_two_is_no_proof(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):
        bench.charger.ignores_stop = True
        bench.wire.lies[Kind.CURRENT] = 0
        flickers = bench.wire.liars[Kind.OPERATION] = Lie(0, every=2)
        assert stop_all({bench.name: None}, 2.0)[bench.name] in (ONCE, RUNS)
        assert flickers.replies > 4


def test_a_charger_that_runs_again_while_it_is_watched_was_not_verified(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,):

        def run_again() -> None:
            bench.charger.ignores_stop = bench.charger.run = True
            bench.charger.resting = False

        later = threading.Timer(1.0, run_again)
        later.start()
        assert stop_all({bench.name: None}, 2.0, watch_s=2.0) == {bench.name: RUNS}
        assert bench.stops > 4, "and was stopped again"


def test_a_strangers_lock_keeps_no_stop_away(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), holding(bench.name):
        assert stop_all({bench.name: None}, 3.0, leave_held=True) == {bench.name: ""}


def test_another_orchestrators_port_is_left_to_it(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), holding(bench.name, name="/opt/bin/orchestrator"):
        assert stop_all({bench.name: None}, 0.6, leave_held=True) == {bench.name: HELD}
        assert bench.stops == 0
