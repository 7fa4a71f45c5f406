"""A guardian in a separate process, with the test as its controller, at the other end of its connection."""

import array
import fcntl
import json
import os
import signal
import socket
import subprocess
import sys
import termios
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import MappingProxyType

from orchestrator.lastresort.guardian import ALIVE, BEAT, PORT
from tests.waiting import wait_until
from tests.whole.station import die_with_parent

#: Arguments: the connection, the controller's code, the calls that hang by port, then guardian constants such as
#: END_S=0.3. Most machines have no GPIO line: a test passes a pipe, and the guardian's requests to the kernel come out
#: at its other end.
LAUNCH = """
import json, os, socket, struct, sys, termios, threading, time
from orchestrator.lastresort import guardian, lastopen
ioctl = lastopen.fcntl.ioctl
def drive(fd, number, asked=0):
    if number != lastopen.SET_VALUES:
        return ioctl(fd, number, asked)
    return os.write(fd, struct.pack("=dI16s", time.monotonic(), number, asked))
lastopen.fcntl.ioctl = drive
def hang(call, port):
    module = os if hasattr(os, call) else termios
    good, device = getattr(module, call), os.path.realpath(port)
    def stuck(which, *rest, **named):
        try:
            name = which if isinstance(which, str) else os.readlink(f"/proc/self/fd/{which}")
        except OSError:
            name = ""
        if os.path.realpath(name) == device:
            threading.Event().wait()
        return good(which, *rest, **named)
    setattr(module, call, stuck)
for call, port in json.loads(sys.argv[3]).items():
    hang(call, port)
for word in sys.argv[4:]:
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
#: By then the guardian has finished anything it does, even on a busy machine.
END_S = 20.0


class Watched:
    """A guardian, and the connection on which it expects a controller."""

    def __init__(self, process: "subprocess.Popen[bytes]", link: socket.socket, log: Path) -> None:
        self.process, self.link = process, link
        self._log = log

    def send(self, message: bytes, fd: int | None = None) -> None:
        rights = [] if fd is None else [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [fd]))]
        self.link.sendmsg([message], rights)

    def hand_over(self, name: str, fd: int | None = None) -> None:
        self.send(PORT + name.encode(), fd)

    def settle(self) -> None:
        """Returns when all messages have been taken, without a heartbeat, which would extend the deadline."""
        wait_until(lambda: not unread_bytes(self.link))
        wait_until(lambda: state_of(self.process.pid) in "SZ")

    def beat(self) -> None:
        """One heartbeat; returns when it is answered, so everything sent before has been taken."""
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
    """Bytes sent and not yet received, as counted by the kernel."""
    return int.from_bytes(fcntl.ioctl(link, termios.TIOCOUTQ, bytes(4)), sys.byteorder)


def children_of(pid: int) -> list[int]:
    """Those alive or not yet reaped."""
    with suppress(FileNotFoundError, ProcessLookupError):
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []


def state_of(pid: int) -> str:
    """A process's state as named by the kernel; "Z" (zombie) also if already reaped."""
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
    hangs: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[Watched]:
    """`hangs`: this system call never returns for this port, as with adapters with dead firmware."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.settimeout(END_S)
    log = directory / "guardian.log"
    environment = {key: value for key, value in os.environ.items() if key != "NOTIFY_SOCKET"}
    with log.open("ab") as file, ours:
        process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                LAUNCH,
                str(theirs.fileno()),
                controller,
                json.dumps(dict(hangs)),
                "VERIFY_S=1",
                *constants,
            ],
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
            for child in left:  # it knows no guardian, and would wait for ever
                os.kill(child, signal.SIGKILL)
