"""The guardian with a controller made by hand: this test holds the other end of its connection."""

import array
import fcntl
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import pytest

from orchestrator.lastresort.guardian import ACTED, ALIVE, BEAT, CONTACTOR, DONE, DROP, PORT, Guardian
from orchestrator.lastresort.lastopen import OPEN, SET_VALUES
from orchestrator.service.guarded import GuardianLink
from tests.devices.fake_charger import charger_on
from tests.guardian.chargers import running_chargers
from tests.link.ptys import plugged
from tests.link.strangers import holding, stty
from tests.waiting import wait_until
from tests.whole.station import die_with_parent

#: Arguments: the connection, the controller's code, then constants of the guardian, as END_S=0.3. There is no GPIO line
#: on most machines: a test hands over a pipe, and what the guardian would ask of the kernel comes out at its other end.
LAUNCH = """
import os, socket, struct, sys, termios, time
from orchestrator.lastresort import guardian, lastopen
ioctl = lastopen.fcntl.ioctl
def drive(fd, number, asked=0):
    if number != lastopen.SET_VALUES:
        return ioctl(fd, number, asked)
    return os.write(fd, struct.pack("=dI16s", time.monotonic(), number, asked))
lastopen.fcntl.ioctl = drive
call, port = sys.argv[3:5]
if call:
    module = os if hasattr(os, call) else termios
    good, device = getattr(module, call), os.path.realpath(port)
    def stuck(which, *rest, **named):
        try:
            name = which if isinstance(which, str) else os.readlink(f"/proc/self/fd/{which}")
        except OSError:
            name = ""
        if os.path.realpath(name) == device:
            while True:
                time.sleep(100)
        return good(which, *rest, **named)
    setattr(module, call, stuck)
for word in sys.argv[5:]:
    name, _, value = word.partition("=")
    assert hasattr(guardian, name)
    setattr(guardian, name, float(value))
child = os.posix_spawn(sys.executable, [sys.executable, "-c", sys.argv[2]], os.environ)
sys.exit(guardian.Guardian(child, socket.socket(fileno=int(sys.argv[1]))).run())
"""
WAITS = "import signal; signal.pause()"
ENDS_WITH_3 = "import sys; sys.exit(3)"
ENDS_WITH_4_WHEN_TOLD = (
    "import signal, sys; signal.signal(15, lambda *_: sys.exit(4)); print(flush=True); signal.pause()"
)
SAYS_WHEN_HUNG_UP = (
    "import signal; signal.signal(1, lambda *_: print('hung up', flush=True)); print(flush=True)\n"
    "while True: signal.pause()"
)
#: A charger that obeys has no current any more.
OBEYED_S = 0.2
#: The guardian is done with whatever it has to do by then, on a busy machine, too.
END_S = 20.0


class Watched:
    """A guardian, and the connection over which it expects a controller."""

    def __init__(self, process: "subprocess.Popen[bytes]", link: socket.socket, log: Path) -> None:
        self.process, self.link = process, link
        self._log = log

    def send(self, message: bytes, fd: int | None = None) -> None:
        rights = [] if fd is None else [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [fd]))]
        self.link.sendmsg([message], rights)

    def hand_over(self, name: str, fd: int | None = None) -> None:
        self.send(PORT + name.encode(), fd)

    def settle(self) -> None:
        """Returns when all that was sent has been taken, without a heartbeat that would put the deadline off."""
        wait_until(lambda: not unread_bytes(self.link))
        wait_until(lambda: state_of(self.process.pid) in "SZ")

    def beat(self) -> None:
        """One heartbeat; returns when it was answered, so that all that was sent before has been taken."""
        self.send(BEAT)
        assert self.link.recv(16) == ALIVE

    def freeze(self) -> None:
        self.process.send_signal(signal.SIGSTOP)
        wait_until(lambda: state_of(self.process.pid) == "T")

    def thaw(self) -> None:
        self.process.send_signal(signal.SIGCONT)

    def ended(self) -> int:
        return self.process.wait(END_S)

    @property
    def log(self) -> str:
        return self._log.read_text()

    @property
    def files(self) -> int:
        return len(list(Path(f"/proc/{self.process.pid}/fd").iterdir()))

    @property
    def controller(self) -> int:
        wait_until(lambda: children_of(self.process.pid), END_S, "the controller")
        return children_of(self.process.pid)[0]

    def waits_for(self, text: str) -> None:
        wait_until(lambda: text in self.log, what=text)


def die_with_parent_in(terminal: int) -> None:
    die_with_parent()
    fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)


def unread_bytes(link: socket.socket) -> int:
    """What was sent and not received yet, as the kernel accounts for it."""
    return int.from_bytes(fcntl.ioctl(link, termios.TIOCOUTQ, bytes(4)), sys.byteorder)


def children_of(pid: int) -> list[int]:
    """Those that live, or are not buried yet."""
    with suppress(FileNotFoundError, ProcessLookupError):
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []


def state_of(pid: int) -> str:
    """A process's state as the kernel names it, "Z" (dead, not buried) also when it is buried already."""
    with suppress(FileNotFoundError, ProcessLookupError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    return "Z"


@contextmanager
def watched(
    directory: Path,
    *constants: str,
    controller: str = WAITS,
    stderr: int | None = None,
    notify: str = "",
    terminal: int | None = None,
    hangs: tuple[str, str] = ("", ""),
) -> Iterator[Watched]:
    """`hangs`: this call of the kernel never returns for this port; it is what adapters do whose firmware is dead."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.settimeout(END_S)
    log = directory / "guardian.log"
    environment = {key: value for key, value in os.environ.items() if key != "NOTIFY_SOCKET"}
    with log.open("ab") as file, ours:
        process = subprocess.Popen(
            [sys.executable, "-c", LAUNCH, str(theirs.fileno()), controller, *hangs, "VERIFY_S=1", *constants],
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=file if stderr is None else stderr,
            pass_fds=[theirs.fileno()],
            env={**environment, **({"NOTIFY_SOCKET": notify} if notify else {})},
            preexec_fn=die_with_parent if terminal is None else partial(die_with_parent_in, terminal),
            start_new_session=True,
        )
        theirs.close()
        try:
            yield Watched(process, ours, log)
        finally:
            left = children_of(process.pid)
            process.kill()
            process.wait()
            for child in left:  # it knows of no guardian, and would wait for ever
                os.kill(child, signal.SIGKILL)


class Contactor:
    """A pipe in the place of a line."""

    def __init__(self) -> None:
        self.reader, self.writer = os.pipe()
        os.set_blocking(self.reader, False)
        self.opened_s: float | None = None  #: when it was first opened

    def opened(self) -> int:
        """How often it was opened since this was last asked; nothing else was done to it."""
        try:
            asked = list(struct.iter_unpack("=dI16s", os.read(self.reader, 4096)))
        except BlockingIOError:
            return 0
        assert {tuple(ask[1:]) for ask in asked} == {(SET_VALUES, OPEN)}
        self.opened_s = self.opened_s or asked[0][0]
        return len(asked)

    def close(self) -> None:
        os.close(self.reader)
        os.close(self.writer)


@pytest.fixture
def contactor() -> Iterator[Contactor]:
    made = Contactor()
    yield made
    made.close()


# --- when it acts, and when not --------------------------------------------------------------------------------------


def test_the_end_of_the_connection_stops_every_charger_and_what_is_left_is_killed(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 3) as benches, watched(tmp_path) as guardian:
        for bench in benches:
            guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        controller = guardian.controller
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert not any(bench.runs for bench in benches)
        assert state_of(controller) == "Z"
        assert guardian.log.splitlines() == [
            "guardian: the controller was ended by SIGKILL: stopping the chargers on 3 ports",
            *(f"guardian: {bench.name}: standby verified" for bench in benches),
        ]


def test_silence_is_a_hang(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        controller = guardian.controller
        assert guardian.ended() == ACTED
        assert not bench.runs
        assert "the controller hangs: stopping" in guardian.log
        assert state_of(controller) == "Z"


def test_heartbeats_keep_it_quiet(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        end_s = time.monotonic() + 1.2
        while time.monotonic() < end_s:
            guardian.beat()
        assert guardian.process.poll() is None
        assert bench.stops == 0


def test_a_controller_that_never_gets_going_is_killed(tmp_path: Path) -> None:
    with watched(tmp_path, "STARTUP_S=0.3") as guardian:
        assert guardian.ended() == ACTED


def test_a_controller_that_starts_slowly_is_waited_for(tmp_path: Path) -> None:
    with watched(tmp_path, "SILENCE_S=0.1") as guardian:
        assert guardian.controller
        assert select.select([guardian.link], [], [], 0.5) == ([], [], [])
        guardian.beat()


@pytest.mark.parametrize(
    ("controller", "status"),
    [(ENDS_WITH_3, 3), ("pass", 0), ("import os; os.kill(os.getpid(), 9)", ACTED), ("import os; os.abort()", ACTED)],
)
def test_without_a_port_the_controllers_end_is_its_own(tmp_path: Path, controller: str, status: int) -> None:
    with watched(tmp_path, controller=controller) as guardian:
        guardian.link.close()
        assert guardian.ended() == status
        assert guardian.log == ""


@pytest.mark.parametrize(("controller", "status"), [(ENDS_WITH_3, 3), ("pass", ACTED)])
def test_with_a_port_no_end_is_a_good_one(tmp_path: Path, controller: str, status: int) -> None:
    """A controller that leaves without a word has not stopped its chargers, whatever its exit status says."""
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, controller=controller) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        wait_until(lambda: state_of(guardian.controller) == "Z")
        guardian.link.close()
        assert guardian.ended() == status
        assert not bench.runs
        assert f"the controller has ended with status {status % ACTED}: stopping" in guardian.log


@pytest.mark.parametrize(("controller", "status"), [(ENDS_WITH_3, 3), ("pass", 0)])
def test_an_orderly_end_needs_no_stop(tmp_path: Path, controller: str, status: int) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, controller=controller) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        guardian.send(DONE)
        guardian.send(DROP + bench.name.encode())
        guardian.link.close()
        assert guardian.ended() == status
        assert bench.stops == 0


def test_an_orderly_end_may_take_its_time(tmp_path: Path) -> None:
    with watched(tmp_path, "SILENCE_S=0.1", controller=ENDS_WITH_4_WHEN_TOLD) as guardian:
        guardian.waits_for("\n")
        guardian.send(DONE)
        assert select.select([guardian.link], [], [], 0.5) == ([], [], [])
        os.kill(guardian.controller, signal.SIGTERM)
        guardian.link.close()
        assert guardian.ended() == 4


@pytest.mark.parametrize("hangs_up", [False, True])
def test_an_orderly_end_that_hangs_is_cut_short(tmp_path: Path, *, hangs_up: bool) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, "END_S=0.3") as guardian:
        controller = guardian.controller
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(DONE)
        if hangs_up:
            guardian.link.close()
        assert guardian.ended() == ACTED
        assert state_of(controller) == "Z"
        assert guardian.log == ""


def test_a_charger_that_does_not_obey_does_not_keep_the_service_from_starting_anew(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, "VERIFY_S=0.6") as guardian:
        bench.charger.ignores_stop = True
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        assert guardian.ended() == ACTED
        assert guardian.log.splitlines() == [
            "guardian: the controller hangs: stopping the chargers on 1 ports",
            f"guardian: CUT THE MAINS of the chargers on {bench.name}",
            f"guardian: {bench.name}: NOT stopped: the charger says that it goes on",
        ]


def test_it_starts_a_controller_that_nobody_can_freeze_and_ends_with_its_status(tmp_path: Path) -> None:
    """Whoever started it may ignore the end of children, which the kernel then buries at once, or block signals."""
    guards = "import signal, sys; from orchestrator.lastresort import guardian; "
    guards += "signal.signal(signal.SIGCHLD, signal.SIG_IGN); "
    guards += "signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM]); "
    guards += "sys.exit(guardian.guard(['our.yaml'], ('-c', sys.argv[1])))"
    controller = """
import os, signal, socket, sys
link = socket.socket(fileno=int(sys.argv[1]))
assert link.type == socket.SOCK_SEQPACKET
link.send(b"B")
assert link.recv(9) == b"A"
link.send(b"E")
keys = (signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)
print(sys.argv[2:], [signal.getsignal(key) is signal.SIG_IGN for key in keys], os.environ["HERE"])
print(signal.pthread_sigmask(signal.SIG_BLOCK, []))
sys.exit(3)
"""
    done = subprocess.run(
        [sys.executable, "-c", guards, controller], env={**os.environ, "HERE": str(tmp_path)}, capture_output=True,
        text=True, timeout=END_S, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (3, "")
    assert done.stdout == f"['our.yaml'] [True, True, True] {tmp_path}\nset()\n"


def test_a_controller_that_does_not_die_is_not_waited_for() -> None:
    """As one that hangs in a driver: SIGKILL does not end it before the driver returns."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    child = subprocess.Popen([sys.executable, "-c", WAITS], preexec_fn=die_with_parent)
    with ours, theirs, child:
        assert Guardian(child.pid, ours)._fate() == (ACTED, "does not die")
        child.kill()


# --- messages --------------------------------------------------------------------------------------------------------


def test_ports_that_come_and_go_leave_nothing_behind(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 2) as benches, watched(tmp_path) as guardian:
        guardian.beat()
        before = guardian.files
        for turn in range(1000):
            bench = benches[turn % 2]
            guardian.hand_over(bench.name, bench.fd)
            if turn % 3:  # else it is handed over again without having been dropped
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
    """Nor does it when the others have to be stopped in the end."""
    with running_chargers(tmp_path, 2) as (stuck, good), watched(tmp_path, hangs=("close", stuck.name)) as guardian:
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


@pytest.mark.parametrize("call", ["open", "write", "isatty", "tcsetattr", "close"])
@pytest.mark.parametrize("is_open", [True, False])
def test_a_driver_that_hangs_delays_no_other_charger_and_not_the_end(
    tmp_path: Path, call: str, *, is_open: bool
) -> None:
    with running_chargers(tmp_path, 3) as benches, watched(tmp_path, hangs=(call, benches[0].name)) as guardian:
        for bench in benches:
            guardian.hand_over(bench.name, bench.fd)
            if not is_open and call != "close":
                guardian.send(DROP + bench.name.encode())
        guardian.beat()
        dies_s = time.monotonic()
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert time.monotonic() - dies_s < 4.0
        for bench in benches[1:]:
            stop_s = bench.wire.counters.first_stop_s
            assert stop_s is not None
            assert stop_s - dies_s < 0.2
            assert f"guardian: {bench.name}: standby verified" in guardian.log


def test_a_port_that_was_closed_when_the_controller_died_is_stopped_all_the_same(tmp_path: Path) -> None:
    with running_chargers(tmp_path, 2) as (closed, sent_in_vain), watched(tmp_path) as guardian:
        guardian.hand_over(closed.name, closed.fd)
        guardian.send(DROP + closed.name.encode())
        guardian.hand_over(sent_in_vain.name)  # as the kernel hands it over when the guardian has no descriptor left
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
        for _ in range(1000):  # far more than the socket takes
            guardian.send(BEAT)
        guardian.settle()
        guardian.link.setblocking(False)
        with suppress(BlockingIOError):
            while True:
                assert guardian.link.recv(16) == ALIVE
        guardian.link.settimeout(END_S)
        guardian.beat()


def test_the_last_words_of_a_controller_that_died_are_heard(tmp_path: Path) -> None:
    """It died with answers unread: the kernel's first word is "connection reset", and what it had sent comes after."""
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
    """The guardian is not let run for so long."""
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
        for _ in range(2):  # each heartbeat gives the next excuse
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


# --- signals, and who may listen -------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGQUIT])
def test_whoever_wants_it_to_end_ends_the_controller_first(tmp_path: Path, number: signal.Signals) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, controller=ENDS_WITH_4_WHEN_TOLD) as guardian:
        guardian.waits_for("\n")  # the controller is ready to be told
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
        guardian.process.send_signal(signal.SIGHUP)  # too early: it reads everything anew anyway
        guardian.beat()
        guardian.beat()  # the first one has been dealt with
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


def test_a_log_that_nobody_reads_does_not_hold_a_stop_up(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    os.set_blocking(writer, True)
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, stderr=writer) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert not bench.runs
    os.close(reader)
    os.close(writer)


def test_a_log_that_is_gone_does_not_hold_a_stop_up(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, stderr=writer) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.beat()
        guardian.link.close()
        assert guardian.ended() == ACTED
        assert not bench.runs
    os.close(writer)


@contextmanager
def systemd(directory: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(directory / "notify"))
        manager.settimeout(END_S)
        yield manager


def heard(manager: socket.socket) -> list[str]:
    """Everything that was notified and not heard yet."""
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
            assert heard(manager) == ["READY=1", "WATCHDOG=1"]  # not with each beat
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
        assert len(fed) >= 2  # the last one may still be on its way, and it may be fed once more meanwhile


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
            for _ in range(2000):  # far more than the socket takes
                guardian.beat()
            guardian.link.close()
            assert guardian.ended() == ACTED
        assert not bench.runs


# --- contactors ------------------------------------------------------------------------------------------------------


def test_a_contactor_opens_after_the_charger_has_had_its_stop(tmp_path: Path, contactor: Contactor) -> None:
    """Without load where the stop was obeyed: a contactor that breaks a current may weld."""
    with running_chargers(tmp_path) as (bench,), watched(tmp_path) as guardian:
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(CONTACTOR + b"bay-1", contactor.writer)
        guardian.beat()
        assert contactor.opened() == 0
        guardian.link.close()
        wait_until(lambda: contactor.opened() > 0, END_S)
        assert not bench.runs
        stop_s = bench.wire.counters.first_stop_s
        assert contactor.opened_s is not None
        assert stop_s is not None
        assert contactor.opened_s - stop_s > OBEYED_S
        assert guardian.ended() == ACTED
        assert guardian.log.splitlines()[-1] == "guardian: contactor bay-1: open"


def test_a_charger_that_does_not_obey_is_cut_off_within_a_second(tmp_path: Path, contactor: Contactor) -> None:
    with running_chargers(tmp_path) as (bench,), watched(tmp_path, "VERIFY_S=5") as guardian:
        bench.charger.ignores_stop = True
        guardian.hand_over(bench.name, bench.fd)
        guardian.send(CONTACTOR + b"bay-1", contactor.writer)
        guardian.beat()
        guardian.link.close()
        wait_until(lambda: contactor.opened() > 0, END_S)
        assert guardian.process.poll() is None, "it goes on to stop the charger"
        assert bench.runs
        assert bench.stops <= 2 * 2, "in the first round; one more on a busy machine"


@pytest.mark.parametrize("orderly", [True, False])
def test_contactors_open_where_no_charger_has_to_be_stopped(
    tmp_path: Path, contactor: Contactor, *, orderly: bool
) -> None:
    with watched(tmp_path, controller="pass") as guardian:
        guardian.send(CONTACTOR + b"bay-1", contactor.writer)
        guardian.beat()
        if orderly:
            guardian.send(DONE)
        guardian.link.close()
        assert guardian.ended() == 0
        assert contactor.opened() == 1


def test_a_line_that_is_given_back_is_free(tmp_path: Path, contactor: Contactor) -> None:
    with watched(tmp_path, controller="pass") as guardian:
        guardian.beat()
        before = guardian.files
        for _ in range(2):  # the second one takes the first one's place
            guardian.send(CONTACTOR + b"bay-1", contactor.writer)
        guardian.beat()
        wait_until(lambda: guardian.files == before + 1)
        guardian.send(CONTACTOR + b"bay-1")
        guardian.beat()
        wait_until(lambda: guardian.files == before)
        guardian.link.close()
        assert guardian.ended() == 0
        assert contactor.opened() == 0


def test_the_controllers_own_words_for_a_line_are_understood(tmp_path: Path, contactor: Contactor) -> None:
    other = Contactor()
    with watched(tmp_path, controller="pass") as guardian:
        link = GuardianLink(os.dup(guardian.link.fileno()))
        link.hold_contactor("bay-1", contactor.writer)
        link.hold_contactor("bay-2", other.writer)
        link.hold_contactor("bay-2", None)
        link._socket.close()
        guardian.link.close()
        assert guardian.ended() == 0
    assert (contactor.opened(), other.opened()) == (1, 0)
    other.close()
