"""The kernel below the unchanged service, call by call, in virtual time: serial ports, files, sockets, standard error.

Every call goes past `Calls`, so that any one of them can be made to fail as kernels do, or to take its time: then only
the thread that called waits. Descriptors belong to processes; a process that is killed loses its threads in the middle
of what they do, its descriptors and its locks.
"""

import errno
import fcntl
import os
import posixpath
import select
import sys
import termios
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from math import inf
from types import SimpleNamespace
from typing import Any

from orchestrator.lastresort.lastopen import GET_LINE, SET_VALUES
from tests.proof.virtual_disk import Disk, Inode, fails
from tests.proof.virtual_gpio import Chip, Output, request_line, set_values
from tests.proof.virtual_threads import Waiting
from tests.proof.virtual_time import Time
from tests.proof.virtual_tty import Tty

#: Descriptors of ours; the others are the real kernel's. None comes twice: what is left of an earlier world, and closes
#: its port when it is collected, must not close one of this world's.
DESCRIPTORS = count(100_001)
#: Everything below it is ours; other paths are the real kernel's.
ROOT = "/virtual/"
TIOCGEXCL = 0x80045440  #: asm-generic/ioctls.h
STDOUT, STDERR = 1, 2
#: A socket takes this many messages.
BACKLOG = 200


@dataclass(slots=True)
class Trouble:
    """Calls of this name, at this place (part of a path; "" anywhere), take so long, or fail with this errno."""

    call: str
    place: str
    until_s: float = inf
    delay_s: float = 0.0
    error: int = 0
    times: float = inf
    exact: bool = False  #: of this path alone, and not of what is below it

    def meets(self, call: str, place: str, now_s: float) -> bool:
        there = self.place == place if self.exact else self.place in place
        return call == self.call and there and now_s < self.until_s and self.times > 0


def real(name: str) -> Callable[..., Any]:
    """The real kernel's, for what is none of ours."""
    return getattr(os, name)  # type: ignore[no-any-return]


class Calls:
    """Every call passes here; `on_call` may raise or return what this one shall return instead."""

    def __init__(self, time: Time) -> None:
        self._time = time
        self.on_call: Callable[[str], Any] | None = None  #: its name → None: go on
        self.troubles: list[Trouble] = []

    def __call__(self, name: str, place: str = "") -> Any:
        if self.troubles:
            self._trouble(name, place)
        return None if self.on_call is None else self.on_call(name)

    def _trouble(self, name: str, place: str) -> None:
        for trouble in self.troubles:
            if trouble.meets(name, place, self._time.now_s):
                trouble.times -= 1
                if trouble.delay_s:
                    self._hang(trouble.delay_s)
                if trouble.error:
                    error = termios.error if name in ("tcgetattr", "tcsetattr", "tcflush") else OSError
                    raise error(trouble.error, os.strerror(trouble.error), place)
                return

    def _hang(self, delay_s: float) -> None:
        """In the kernel: nothing wakes this thread earlier, and its process cannot die before."""
        process, until_s = self._time.me().process, self._time.now_s + delay_s
        if process is not None:
            process.in_kernel(until_s)
        while self._time.now_s < until_s:
            self._time.wait(until_s)


@dataclass(slots=True, eq=False)
class Node:
    """What is behind an open file that is no tty and no file: `news` where something comes in."""

    time: Time
    news: Waiting = field(init=False)

    def __post_init__(self) -> None:
        self.news = Waiting(self.time)


@dataclass(slots=True, eq=False)
class Socket(Node):
    """One end of a pair of SOCK_SEQPACKET sockets."""

    peer: "Socket | None" = None
    heard: deque[tuple[bytes, list[int]]] = field(default_factory=deque)
    closed: bool = False
    reset: bool = False  #: the other end died with messages of ours unread


@dataclass(slots=True, eq=False)
class Stream(Node):
    """Standard error or output; `stopped`: who reads it stands still (Ctrl-S), and it is full."""

    stopped: bool = False


@dataclass(slots=True, eq=False)
class Death(Node):
    """A pidfd."""

    process: Any = None


@dataclass(slots=True, eq=False)
class File:
    """An open file; several descriptors, of several processes, may stand for it."""

    path: str
    what: Tty | Inode | Socket | Stream | Death | Chip | Output | None
    flags: int = 0
    at: int = 0
    owners: int = 0
    locker: Any = None  #: the process that has locked it


class Proc:
    """/proc, as far as the product reads it; without processes of ours it is the real one."""

    def has(self, _path: str) -> bool:
        return False

    def text(self, _path: str) -> str:
        return ""

    def listdir(self, _path: str) -> list[str]:
        return []

    def link(self, _path: str) -> str:
        return ""


class Kernel:
    """Ports, files and sockets, and the calls of `os`, `fcntl`, `termios`, `select` and `socket` for them."""

    def __init__(self, time: Time, disk: Disk | None = None) -> None:
        self.time = time
        self.calls = Calls(time)
        self.ttys: dict[str, Tty] = {}
        self.chips: dict[str, Chip] = {}
        self.clock_off_s = 0.0  #: somebody has set the wall clock
        self.disk = disk or Disk(ROOT.rstrip("/"))
        self.output = {STDOUT: Stream(time), STDERR: Stream(time)}
        self.on_said: Callable[[Any, str], None] = lambda _process, _text: None
        self.proc = Proc()
        self._open: dict[int, tuple[File, set[Any]]] = {}  # the file, and whose descriptor it is

    def add(self, path: str) -> Tty:
        self.ttys[path] = Tty(self.time)
        return self.ttys[path]

    @property
    def me(self) -> Any:
        return self.time.me().process

    # --- descriptors --------------------------------------------------------------------------------------------------

    def _new(self, file: File, owner: Any = None) -> int:
        fd = next(DESCRIPTORS)
        file.owners += 1
        self._open[fd] = file, {owner or self.me}
        return fd

    def file(self, fd: Any) -> File:
        entry = self._open.get(self.number(fd))
        if entry is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return entry[0]

    def number(self, fd: Any) -> int:
        return fd if isinstance(fd, int) else int(fd.fileno())

    def ours(self, fd: Any) -> bool:
        return self.number(fd) > 100_000

    def share(self, fd: int, process: Any) -> None:
        """A child inherits it."""
        self._open[fd][1].add(process)

    def copy(self, fd: int, owner: Any = None) -> int:
        """Another descriptor of the same open file: dup, or SCM_RIGHTS."""
        return self._new(self.file(fd), owner)

    def close(self, fd: int) -> None:
        if not self.ours(fd):
            os.close(fd)
            return
        file = self.file(fd)
        self._drop(fd, self.me)
        if isinstance(file.what, Tty | Inode):
            self.calls("close", file.path)  # the descriptor is gone, whatever close says

    def _drop(self, fd: int, owner: Any) -> None:
        file, owners = self._open[fd]
        owners.discard(owner)
        if owners:
            return
        del self._open[fd]
        file.owners -= 1
        if not file.owners:
            self._last_close(file)

    def _last_close(self, file: File) -> None:
        what = file.what
        if isinstance(what, Tty):
            what.opened -= 1
        if isinstance(what, Tty | Inode) and what.lock is file:
            what.lock = None
        if isinstance(what, Output):
            what.held = False
        if isinstance(what, Socket):
            what.closed = True
            if what.peer is not None:
                what.peer.reset = bool(what.heard)
                what.peer.news.wake()

    def bury(self, process: Any) -> None:
        """It has died: what it had open is closed."""
        for fd in [fd for fd, (_, owners) in self._open.items() if process in owners]:
            self._drop(fd, process)

    # --- ports and files ----------------------------------------------------------------------------------------------

    def open(self, path: Any, flags: int, mode: int = 0o777, *, dir_fd: Any = None) -> int:
        name = os.fspath(path)
        if isinstance(name, str) and (name == "/dev/tty" or "\0" in name):
            raise ValueError("embedded null byte") if "\0" in name else fails(errno.ENXIO, name)
        if self.proc.has(name):
            return self._new(File(name, Inode(0, bytearray(self.proc.text(name).encode())), flags))
        if not self.is_ours(name):
            return os.open(path, flags, mode, dir_fd=dir_fd)
        self.calls("open", name)
        if name in self.chips:
            return self._open_chip(name)
        tty = self.ttys.get(name)
        if tty is None:
            if name.removeprefix(ROOT).isdigit():
                raise fails(errno.ENOENT, name)  # an adapter that is not there
            return self._new(File(name, self.disk.open(name, flags), flags))
        if not tty.present:
            raise fails(errno.ENOENT, name)
        if tty.exclusive:
            raise fails(errno.EBUSY, name)
        tty.opened += 1
        return self._new(File(name, tty, flags))

    def _open_chip(self, name: str) -> int:
        if not self.chips[name].present:
            raise fails(errno.ENOENT, name)
        return self._new(File(name, self.chips[name]))

    def new_line(self, name: str, output: Output) -> int:
        """The descriptor of a line that was requested."""
        return self._new(File(name, output))

    def is_ours(self, path: Any) -> bool:
        return isinstance(path, str) and path.startswith(ROOT)

    def pipe(self) -> tuple[int, int]:
        self.calls("pipe")
        return self._new(File("pipe", None)), self._new(File("pipe", None))

    def read(self, fd: int, size: int) -> bytes:
        if not self.ours(fd):
            return os.read(fd, size)
        file = self.file(fd)
        told = self.calls("read", file.path)
        if told is not None:
            return bytes(told)
        what = file.what
        if isinstance(what, Inode):
            if file.path in self.disk.directories:
                raise fails(errno.EISDIR, file.path)
            data = bytes(what.data[file.at : file.at + size])
            file.at += len(data)
            return data
        tty = self._tty(fd)
        if not tty.present:
            return b""  # as of a USB adapter that was unplugged
        data, tty.waiting_bytes = tty.waiting_bytes[:size], tty.waiting_bytes[size:]
        if not data:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        return data

    def write(self, fd: int, data: bytes) -> int:
        if fd in self.output:
            return self._say(fd, bytes(data))
        if not self.ours(fd):
            return os.write(fd, data)
        file = self.file(fd)
        told = self.calls("write", file.path)
        what = file.what
        if isinstance(what, Inode):
            file.at = len(what.data) if file.flags & os.O_APPEND else file.at
            self.disk.write(what, file.at, bytes(data))
            file.at += len(data)
            return len(data)
        tty = self._tty(fd)
        if not tty.present:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        if tty.stalled:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        taken = len(data) if told is None else min(int(told), len(data))
        tty.take(bytes(data[:taken]))
        return taken

    def _say(self, fd: int, data: bytes) -> int:
        self.calls("write", "stderr")
        while self.output[fd].stopped:
            if self.me is not None:
                self.me.in_kernel(inf, interruptible=True)
            self.output[fd].news.wait(None)
        self.on_said(self.me, data.decode(errors="replace"))
        return len(data)

    def fsync(self, fd: Any) -> None:
        if not self.ours(fd):
            os.fsync(fd)
            return
        file = self.file(fd)
        self.calls("fsync", file.path)
        if file.path in self.disk.directories:
            self.disk.sync_directory(file.path)
        elif isinstance(file.what, Inode):
            self.disk.sync(file.what)

    def ftruncate(self, fd: int, size: int) -> None:
        if not self.ours(fd):
            os.ftruncate(fd, size)
            return
        what = self.file(fd).what
        assert isinstance(what, Inode)
        self.calls("write", self.file(fd).path)
        self.disk.truncate(what, size)

    def lseek(self, fd: int, at: int, whence: int) -> int:
        if not self.ours(fd):
            return os.lseek(fd, at, whence)
        file = self.file(fd)
        if not isinstance(file.what, Inode):
            raise OSError(errno.ESPIPE, os.strerror(errno.ESPIPE))
        file.at = at + {os.SEEK_SET: 0, os.SEEK_CUR: file.at, os.SEEK_END: len(file.what.data)}[whence]
        return file.at

    def rename(self, old: Any, new: Any) -> None:
        if not self.is_ours(os.fspath(old)):
            real("replace")(old, new)
            return
        self.calls("rename", os.fspath(new))
        self.disk.rename(os.fspath(old), os.fspath(new))

    def unlink(self, path: Any) -> None:
        if not self.is_ours(os.fspath(path)):
            real("unlink")(path)
            return
        self.calls("unlink", os.fspath(path))
        self.disk.unlink(os.fspath(path))

    def mkdir(self, path: Any, mode: int = 0o777) -> None:
        if not self.is_ours(os.fspath(path)):
            real("mkdir")(path, mode)
            return
        self.calls("mkdir", os.fspath(path))
        self.disk.mkdir(os.fspath(path))

    def makedirs(self, path: Any, mode: int = 0o777, exist_ok: bool = False) -> None:
        name = os.fspath(path)
        if not self.is_ours(name):
            real("makedirs")(path, mode, exist_ok)
            return
        self.calls("mkdir", name)
        missing = []
        while name not in self.disk.directories:
            missing.append(name)
            name = posixpath.dirname(name)
        if not missing and not exist_ok:
            raise fails(errno.EEXIST, name)
        for directory in reversed(missing):
            self.disk.mkdir(directory)

    def listdir(self, path: Any = ".") -> list[str]:
        name = os.fspath(path)
        if self.proc.has(name):
            return self.proc.listdir(name)
        if not self.is_ours(name):
            return list(real("listdir")(path))
        self.calls("open", name)
        return self.disk.listdir(name)

    def stat(self, path: Any, *, dir_fd: Any = None, follow_symlinks: bool = True) -> Any:
        if isinstance(path, int):
            return self.fstat(path)
        if not self.is_ours(os.fspath(path)):
            return os.stat(path, dir_fd=dir_fd, follow_symlinks=follow_symlinks)
        if os.fspath(path) in self.ttys:
            return self._stat_of(self.ttys[os.fspath(path)], os.fspath(path))
        return self.disk.stat(os.fspath(path))

    def fstat(self, fd: int) -> Any:
        if not self.ours(fd):
            return os.fstat(fd)
        file = self.file(fd)
        if isinstance(file.what, Inode):
            return self.disk.stat(file.path) if file.path in self.disk.directories else self.disk.fstat(file.what)
        return self._stat_of(file.what, file.path)

    def _stat_of(self, what: Any, path: str) -> SimpleNamespace:
        if isinstance(what, Tty) and not what.present:
            raise fails(errno.ENOENT, path)
        number = sum(path.encode())
        return SimpleNamespace(st_mode=0o020600, st_size=0, st_ino=number, st_dev=2, st_rdev=number, st_nlink=1)

    def readlink(self, path: Any, **_: Any) -> str:
        name = os.fspath(path)
        return self.proc.link(name) if self.proc.has(name) else str(real("readlink")(path))

    def exists(self, path: Any) -> bool:
        try:
            self.stat(path)
        except (OSError, ValueError):
            return False
        return True

    def isatty(self, fd: int) -> bool:
        return isinstance(self.file(fd).what, Tty) if self.ours(fd) else os.isatty(fd)

    # --- waiting ------------------------------------------------------------------------------------------------------

    def select(
        self, readers: Iterable[int], writers: Iterable[int], _: object, timeout: float | None = None
    ) -> tuple[list[int], list[int], list[int]]:
        self.calls("select")
        readers, writers = list(readers), list(writers)
        end_s = inf if timeout is None else self.time.now_s + timeout
        while True:
            can_read, can_write = list(filter(self.readable, readers)), list(filter(self.writable, writers))
            if can_read or can_write or self.time.now_s >= end_s:
                return can_read, can_write, []
            self.sleep([*readers, *writers], end_s)

    def sleep(self, fds: Iterable[int], end_s: float) -> None:
        """Until something happens to one of these, or until then."""
        with self._listening([what for fd in fds if (what := self._what(fd)) is not None]):
            self.time.wait(end_s)

    @contextmanager
    def _listening(self, nodes: list[Any]) -> Iterator[None]:
        me = self.time.me()
        for node in nodes:
            node.news.waiting.append(me)
        try:
            yield
        finally:
            for node in nodes:
                node.news.waiting.remove(me)

    def _what(self, fd: Any) -> Any:
        number = self.number(fd)
        if number in self.output:
            return self.output[number]
        entry = self._open.get(number)
        return None if entry is None or isinstance(entry[0].what, Inode) else entry[0].what

    def readable(self, fd: Any) -> bool:
        what = self._what(fd)
        if isinstance(what, Tty):
            return what.readable or not what.present
        if isinstance(what, Socket):
            return bool(what.heard) or what.peer is None or what.peer.closed
        return isinstance(what, Death) and what.process.dead

    def writable(self, fd: Any) -> bool:
        what = self._what(fd)
        if isinstance(what, Tty):
            return not what.stalled or not what.present
        return isinstance(what, Socket) or (isinstance(what, Stream) and not what.stopped)

    # --- the tty's own calls ------------------------------------------------------------------------------------------

    def _tty(self, fd: int) -> Tty:
        what = self.file(fd).what
        if not isinstance(what, Tty):
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        return what

    def ioctl(self, fd: int, request: int = 0, argument: Any = 0, *_: object) -> int:
        file = self.file(fd)
        if isinstance(file.what, Chip | Output):
            self.calls("ioctl", file.path)
            return self._ioctl_line(file, request, argument)
        tty = self._tty(fd)
        self.calls("ioctl", file.path)
        if request in (termios.TIOCEXCL, termios.TIOCNXCL):
            tty.exclusive = request == termios.TIOCEXCL
        elif request == TIOCGEXCL:
            argument[:4] = int(tty.exclusive).to_bytes(4, sys.byteorder)
        return 0

    def _ioctl_line(self, file: File, request: int, argument: Any) -> int:
        if not self.chips[file.path.split(":")[0]].present:
            raise fails(errno.ENODEV, file.path)
        if isinstance(file.what, Chip) and request == GET_LINE:
            return request_line(self, file.what, file.path, argument)
        if isinstance(file.what, Output) and request == SET_VALUES:
            return set_values(file.what, argument)
        raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))

    def flock(self, fd: int, operation: int) -> None:
        file = self.file(fd)
        what = file.what
        assert isinstance(what, Tty | Inode)
        if operation & fcntl.LOCK_UN:
            what.lock = None if what.lock is file else what.lock
            return
        self.calls("flock", file.path)
        file.locker = self.me
        while what.lock not in (None, file):
            if operation & fcntl.LOCK_NB:
                raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
            self.time.wait(self.time.now_s + 0.1)
        what.lock = file

    def _tty_call(self, name: str, fd: Any) -> Tty:
        try:
            tty = self._tty(self.number(fd))
        except OSError as error:
            raise termios.error(error.errno, error.strerror) from None
        self.calls(name, self.file(fd).path)
        if not tty.present:
            raise termios.error(errno.EIO, os.strerror(errno.EIO))
        return tty

    def tcgetattr(self, fd: Any) -> list[Any]:
        return self._tty_call("tcgetattr", fd).shown()

    def tcsetattr(self, fd: Any, _when: int, settings: list[Any]) -> None:
        self._tty_call("tcsetattr", fd).set(settings)

    def tcflush(self, fd: Any, queue: int) -> None:
        tty = self._tty_call("tcflush", fd)
        if queue in (termios.TCIFLUSH, termios.TCIOFLUSH):
            tty.waiting_bytes = b""
        if queue in (termios.TCOFLUSH, termios.TCIOFLUSH):
            tty.held_back.clear()

    # --- what takes the modules' places -------------------------------------------------------------------------------

    def modules(self) -> dict[str, SimpleNamespace]:
        fake_os = SimpleNamespace(**vars(os))
        for name in (
            "open", "close", "read", "write", "pipe", "fsync", "ftruncate", "lseek", "rename", "unlink", "mkdir",
            "makedirs", "listdir", "stat", "fstat", "isatty", "readlink",
        ):  # fmt: skip
            setattr(fake_os, name, getattr(self, name))
        fake_os.replace, fake_os.remove, fake_os.fdatasync = self.rename, self.unlink, self.fsync
        fake_os.lstat, fake_os.dup = self.stat, self.copy
        fake_os.set_blocking = lambda fd, flag: None if self.ours(fd) else os.set_blocking(fd, flag)
        fake_os.truncate = self._truncate
        fake_os.path = SimpleNamespace(**vars(os.path))
        fake_os.path.exists = fake_os.path.lexists = self.exists
        fake_os.path.realpath = lambda path, **_: path if self.is_ours(os.fspath(path)) else os.path.realpath(path)
        fake_os.path.getsize = lambda path: self.stat(path).st_size
        fake_termios = SimpleNamespace(**vars(termios))
        fake_termios.tcgetattr, fake_termios.tcsetattr = self.tcgetattr, self.tcsetattr
        fake_termios.tcflow = lambda fd, action: self._tty_call("tcflow", fd).flow(goes=action == termios.TCOON)
        fake_termios.tcflush, fake_termios.tcdrain = self.tcflush, lambda fd: self._tty_call("tcdrain", fd) and None
        fake_select = SimpleNamespace(**vars(select))
        fake_select.select, fake_select.poll = self.select, lambda: Poll(self)
        fake_fcntl = SimpleNamespace(**vars(fcntl))
        fake_fcntl.fcntl, fake_fcntl.ioctl, fake_fcntl.flock = lambda *_: 0, self.ioctl, self.flock
        return {"os": fake_os, "fcntl": fake_fcntl, "termios": fake_termios, "select": fake_select}

    def _truncate(self, path: Any, size: int) -> None:
        fd = self.open(path, os.O_WRONLY)
        try:
            self.ftruncate(fd, size)
        finally:
            self.close(fd)


class Poll:
    """`select.poll()`."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._masks: dict[int, int] = {}

    def register(self, fd: Any, mask: int = select.POLLIN | select.POLLOUT) -> None:
        self._masks[self._kernel.number(fd)] = mask

    def unregister(self, fd: Any) -> None:
        del self._masks[self._kernel.number(fd)]

    modify = register

    def poll(self, timeout_ms: float | None = None) -> list[tuple[int, int]]:
        kernel = self._kernel
        told = kernel.calls("poll")
        if told is not None:
            return [(fd, int(told)) for fd in self._masks]
        end_s = inf if timeout_ms is None or timeout_ms < 0 else kernel.time.now_s + timeout_ms / 1000
        while not (ready := list(self._ready())) and kernel.time.now_s < end_s:
            kernel.sleep(self._masks, end_s)
        return ready

    def _ready(self) -> Iterator[tuple[int, int]]:
        kernel = self._kernel
        for fd, mask in self._masks.items():
            events = (mask & select.POLLIN) * kernel.readable(fd) | (mask & select.POLLOUT) * kernel.writable(fd)
            if kernel.ours(fd) and fd not in kernel._open:
                events = select.POLLNVAL
            if events:
                yield fd, events
