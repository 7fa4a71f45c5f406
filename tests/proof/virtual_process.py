"""Processes in virtual time: started, signalled, frozen, killed; and the sockets between them.

A killed process loses its threads in the middle of their work, without clean-up. A process with a thread in a call that
does not return dies only when it returns: until then its descriptors and locks stay.
"""

import errno
import os
import select
import signal
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import count
from math import inf
from types import SimpleNamespace
from typing import Any, Self

from tests.proof.virtual_files import Death, File, Proc, Socket
from tests.proof.virtual_kernel import Kernel
from tests.proof.virtual_time import Runner, StuckError
from tests.proof.virtual_waits import Poll

PIDS = count(5000)
#: A socket takes this many messages.
BACKLOG = 200
KILLS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)


class Exit(BaseException):
    """`os._exit` and the like."""


class Process:
    """One process: its threads are the runners naming it."""

    def __init__(self, name: str, kernel: Kernel, words: Sequence[str] = ()) -> None:
        self.name, self.pid, self.words = name, next(PIDS), tuple(words)
        self.parent = 1
        self.frozen = False
        self.waiting: list[Runner] = []  #: threads to continue when it is thawed
        self.handlers: dict[int, Any] = {}
        self.status: int | None = None  #: exit status, or −signal, as soon as it is dying
        self.dead = False  #: and reaped
        self.said: list[str] = []  #: standard output and error
        self._kernel = kernel
        self._busy_until_s = 0.0
        self._deaths: list[Death] = []

    def run(self, main: Callable[[], object]) -> "Process":
        """Start; the exit status is the result of `main`."""
        self._kernel.time.start(partial(self._main, main), self)
        return self

    def _main(self, main: Callable[[], object]) -> None:
        try:
            status = main()
        except (Exit, SystemExit) as end:
            status = end.args[0] if end.args else 0
        except StuckError:
            raise
        except BaseException as error:  # noqa: BLE001 - like the interpreter: a traceback, and status 1
            self.said.append(f"Traceback: {error!r} in {self.name}")
            status = 1
        # The interpreter ends its remaining threads; this one too, from outside.
        self._kernel.time.call_soon(self.end, int(status or 0))  # type: ignore[call-overload]
        self._kernel.time.wait(inf)

    def in_kernel(self, until_s: float, *, interruptible: bool = False) -> None:
        """A thread is in a call until then; the process cannot die earlier unless the call can be interrupted."""
        if not interruptible:
            self._busy_until_s = max(self._busy_until_s, until_s)

    @property
    def hangs(self) -> bool:
        """A thread is in an uninterruptible call."""
        return self._busy_until_s > self._kernel.time.now_s

    def end(self, status: int) -> None:
        """End it with this status, or −signal. Not for its own threads to call."""
        if self.status is not None:
            return
        self.status = status
        time = self._kernel.time
        time.kill(self)
        if self.hangs and status < 0:
            if self._busy_until_s < inf:
                time.call_at(self._busy_until_s, self._bury)
        else:
            self._bury()

    def _bury(self) -> None:
        self.dead = True
        self._kernel.bury(self)
        for death in self._deaths:
            death.news.wake()

    def signal(self, number: int) -> None:
        """Like `kill`. Not for its own threads to call."""
        if self.status is not None:
            return
        if number == signal.SIGSTOP:
            self.frozen = True
        elif number == signal.SIGCONT:
            self._thaw()
        elif number == signal.SIGKILL or self.handlers.get(number, signal.SIG_DFL) == signal.SIG_DFL:
            if number in KILLS:
                self.end(-number)
        elif callable(handler := self.handlers[number]):
            self._kernel.time.start(partial(handler, number, None), self)

    def _thaw(self) -> None:
        self.frozen = False
        for runner in self.waiting:
            self._kernel.time.wake(runner)
        self.waiting.clear()

    def pidfd(self) -> Death:
        death = Death(self._kernel.time, self)
        self._deaths.append(death)
        return death


class Processes:
    """All processes, and the calls of `signal`, `socket` and `os` about them."""

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.all: dict[int, Process] = {}
        kernel.proc = VirtualProc(self)
        self.on_spawn: Callable[[Process, Sequence[str]], Callable[[], object]] = lambda *_: lambda: 127

    def new(self, name: str, *words: str) -> Process:
        process = Process(name, self.kernel, words)
        self.all[process.pid] = process
        return process

    # --- os -----------------------------------------------------------------------------------------------------------

    def extend_os(self, fake_os: SimpleNamespace) -> None:
        fake_os.posix_spawn, fake_os.pidfd_open, fake_os.waitid = self._spawn, self._pidfd_open, self._waitid
        fake_os.getpid = lambda: self.kernel.me.pid if self.kernel.me is not None else os.getpid()
        fake_os.getppid = lambda: self.kernel.me.parent if self.kernel.me is not None else os.getppid()
        fake_os._exit = self._exit

    def _exit(self, status: int) -> None:
        self.kernel.time.call_soon(self.kernel.me.end, status)
        self.kernel.time.wait(inf)

    def _spawn(self, _path: str, command: Sequence[str], _environ: Mapping[str, str], **_: object) -> int:
        child = self.new("controller", *command)
        child.parent = self.kernel.me.pid
        child.handlers = {
            number: handler for number, handler in self.kernel.me.handlers.items() if handler is signal.SIG_IGN
        }
        for fd, (file, owners) in self.kernel._open.items():
            if self.kernel.me in owners and isinstance(file.what, Socket) and str(fd) in command:
                owners.add(child)
        child.run(self.on_spawn(child, command))
        return child.pid

    def _pidfd_open(self, pid: int, _flags: int = 0) -> int:
        return self.kernel._new(File("pidfd", self.all[pid].pidfd()))

    def _waitid(self, _kind: int, fd: int, options: int) -> SimpleNamespace | None:
        process = self._of(fd)
        if not process.dead:
            return None
        killed = process.status is not None and process.status < 0
        status = -process.status if killed and process.status is not None else process.status
        return SimpleNamespace(si_code=os.CLD_KILLED if killed else os.CLD_EXITED, si_status=status)

    def _of(self, fd: int) -> Process:
        death = self.kernel.file(fd).what
        assert isinstance(death, Death)
        return death.process  # type: ignore[no-any-return]

    # --- signal -------------------------------------------------------------------------------------------------------

    def signal_module(self) -> SimpleNamespace:
        fake = SimpleNamespace(**vars(signal))
        fake.signal = self._signal
        fake.getsignal = lambda number: self.kernel.me.handlers.get(number, signal.SIG_DFL)
        fake.pidfd_send_signal = lambda fd, number: self._kill(self._of(fd), number)
        fake.pthread_sigmask = lambda *_: set()
        fake.set_wakeup_fd = lambda *_, **__: -1
        return fake

    def _signal(self, number: int, handler: Any) -> Any:
        before = self.kernel.me.handlers.get(number, signal.SIG_DFL)
        self.kernel.me.handlers[number] = handler
        return before

    def _kill(self, process: Process, number: int) -> None:
        if process.dead:
            return  # not waited for: it exists until then
        self.kernel.time.call_soon(process.signal, number)
        self.kernel.time.wait(self.kernel.time.now_s)

    # --- socket -------------------------------------------------------------------------------------------------------

    def socket_module(self) -> SimpleNamespace:
        fake = SimpleNamespace(**vars(socket))
        fake.socketpair = self._socketpair
        fake.socket = self._socket
        fake.recv_fds = lambda link, size, most: link.recv_fds(size, most)
        fake.send_fds = lambda link, messages, fds: link.sendmsg(messages, [(0, 0, fds)])
        return fake

    def _socketpair(self, *_: object, **__: object) -> "tuple[Link, Link]":
        time = self.kernel.time
        one, other = Socket(time), Socket(time)
        one.peer, other.peer = other, one
        return tuple(Link(self.kernel, self.kernel._new(File("socket", end))) for end in (one, other))  # type: ignore[return-value]

    def _socket(self, *_: object, fileno: int | None = None, **__: object) -> "Link":
        if fileno is None:
            raise OSError(errno.EAFNOSUPPORT, "no other sockets here")
        return Link(self.kernel, fileno)


class Link:
    """One end of a socket pair, in one process."""

    def __init__(self, kernel: Kernel, fd: int) -> None:
        self._kernel, self._fd = kernel, fd
        self._timeout_s: float | None = None

    def fileno(self) -> int:
        return self._fd

    def set_inheritable(self, _flag: bool) -> None:
        """Only descriptors named on a command line are inherited here."""

    def settimeout(self, timeout_s: float | None) -> None:
        self._timeout_s = timeout_s

    def setblocking(self, flag: bool) -> None:
        self._timeout_s = None if flag else 0.0

    def close(self) -> None:
        self._kernel.close(self._fd)

    def detach(self) -> int:
        return self._fd

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _end(self) -> Socket:
        end = self._kernel.file(self._fd).what
        assert isinstance(end, Socket)
        return end

    def sendmsg(self, messages: Sequence[bytes], ancillary: Sequence[Any] = (), _flags: int = 0) -> int:
        end = self._end()
        if end.peer is None or end.peer.closed:
            raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))
        if len(end.peer.heard) >= BACKLOG:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        # A descriptor in transit belongs to no process yet: it is copied for the other end, which gets it on reading.
        fds = [self._kernel.copy(fd, end.peer) for _, _, fds in ancillary for fd in fds]
        end.peer.heard.append((b"".join(messages), fds))
        end.peer.news.wake()
        return sum(map(len, messages))

    def send(self, data: bytes, flags: int = 0) -> int:
        return self.sendmsg([data], (), flags)

    sendall = send

    def recv_fds(self, _size: int, _most: int) -> tuple[bytes, list[int], int, None]:
        end = self._end()
        if not end.heard and end.reset:
            end.reset = False
            raise ConnectionResetError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
        if not end.heard and end.peer is not None and not end.peer.closed:
            if self._timeout_s == 0:
                raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
            news = Poll(self._kernel)
            news.register(self._fd, select.POLLIN)
            if not news.poll(None if self._timeout_s is None else self._timeout_s * 1000):
                raise TimeoutError("timed out")
        if not end.heard:
            return b"", [], 0, None
        data, fds = end.heard.popleft()
        for fd in fds:
            owners = self._kernel._open[fd][1]
            owners.clear()
            owners.add(self._kernel.me)
        return data, fds, 0, None

    def recv(self, size: int) -> bytes:
        data, fds, _, _ = self.recv_fds(size, 0)
        for fd in fds:
            self._kernel.close(fd)
        return data


class VirtualProc(Proc):
    """/proc of these processes: names, open files, locks. A dying one has an empty command line."""

    def __init__(self, processes: Processes) -> None:
        self._processes = processes

    def has(self, path: str) -> bool:
        return path.startswith("/proc") and not path.startswith("/proc/sys")

    def text(self, path: str) -> str:
        if path == "/proc/locks":
            return "".join(self._locks())
        process = self._process(path)
        name = path.rsplit("/", 1)[-1]
        if name == "cmdline":
            return "".join(f"{word}\0" for word in process.words) if process.status is None else ""
        return process.name if name == "comm" else ""

    def listdir(self, path: str) -> list[str]:
        if path == "/proc":
            return [str(process.pid) for process in self._processes.all.values() if not process.dead]
        return [str(fd) for fd in self._files(self._process(path))]

    def link(self, path: str) -> str:
        if path.endswith("/cwd"):
            return "/virtual"
        return self._processes.kernel.file(int(path.rsplit("/", 1)[-1])).path

    def _process(self, path: str) -> Process:
        process = self._processes.all.get(int(path.split("/")[2]))
        if process is None or process.dead:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
        return process

    def _files(self, process: Process) -> list[int]:
        return [fd for fd, (_, owners) in self._processes.kernel._open.items() if process in owners]

    def _locks(self) -> Iterator[str]:
        kernel = self._processes.kernel
        for name, tty in kernel.ttys.items():
            if tty.lock is not None and tty.present:
                at = kernel.stat(name)
                locker = getattr(tty.lock, "locker", None)
                pid = locker.pid if locker is not None else 0
                device = f"{os.major(at.st_dev):02x}:{os.minor(at.st_dev):02x}"
                yield f"1: FLOCK ADVISORY WRITE {pid} {device}:{at.st_ino} 0 EOF\n"
