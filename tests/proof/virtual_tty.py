"""Serial ports in memory, below the unchanged pyserial: what the kernel would do, in virtual time, call by call.

Every call that touches a port goes past `Calls`, so that any one of them can be made to fail as kernels do.
"""

import errno
import os
import select
import termios
from collections.abc import Callable, Iterable
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import count
from math import inf
from types import SimpleNamespace
from typing import Any

from tests.proof.virtual_threads import Waiting
from tests.proof.virtual_time import Time

#: Descriptors of ours; the others are the real kernel's. None comes twice: what is left of an earlier world, and closes
#: its port when it is collected, must not close one of this world's.
DESCRIPTORS = count(100_001)
#: What a tty takes before it is full.
ROOM = 4096


class Calls:
    """Every call passes here; `on_call` may raise or return what this one shall return instead."""

    def __init__(self) -> None:
        self.on_call: Callable[[str], Any] | None = None  #: its name → None: go on

    def __call__(self, name: str) -> Any:
        return None if self.on_call is None else self.on_call(name)


@dataclass(slots=True)
class Tty:
    """One port. `listener` gets what is written to it; `deliver` brings bytes in."""

    time: Time
    present: bool = True
    stalled: bool = False  #: takes nothing any more
    waiting_bytes: bytes = b""
    listener: Callable[[bytes], None] = lambda _: None
    on_delivered: Callable[[int], None] = lambda _: None  #: so many bytes have come in
    opened: int = 0  #: how many descriptors
    settings: list[Any] = field(default_factory=lambda: [0, 0, 0, 0, 0, 0, [b"\0"] * 32])  #: as tcgetattr gives them
    locked: bool = False
    news: Waiting = field(init=False)

    def __post_init__(self) -> None:
        self.news = Waiting(self.time)

    def deliver(self, data: bytes) -> None:
        if self.present and self.opened:
            self.waiting_bytes = (self.waiting_bytes + data)[:ROOM]
            self.news.wake()
            self.on_delivered(len(data))

    def unplug(self) -> None:
        self.present, self.waiting_bytes = False, b""
        self.news.wake()


class Kernel:
    """The ports by path, and the calls of `os`, `fcntl`, `termios` and `select` for them."""

    def __init__(self, time: Time) -> None:
        self.time = time
        self.calls = Calls()
        self.ttys: dict[str, Tty] = {}
        self._open: dict[int, Tty | None] = {}

    def add(self, path: str) -> Tty:
        self.ttys[path] = Tty(self.time)
        return self.ttys[path]

    # --- what takes the modules' places in pyserial and in link/serial.py ---------------------------------------------

    def modules(self) -> dict[str, SimpleNamespace]:
        fake_os = SimpleNamespace(**vars(os))
        fake_os.open, fake_os.close, fake_os.read, fake_os.write = self.open, self.close, self.read, self.write
        fake_os.pipe = self.pipe
        fake_termios = SimpleNamespace(**vars(termios))
        fake_termios.tcgetattr = self._tcgetattr
        fake_termios.tcsetattr = self._tcsetattr
        fake_termios.tcflow = lambda fd, _: self._touch("tcflow", fd)
        fake_termios.tcflush = self._tcflush
        fake_select = SimpleNamespace(**vars(select))
        fake_select.select, fake_select.poll = self.select, lambda: Poll(self)
        fake_fcntl = SimpleNamespace(
            fcntl=lambda *_: 0, ioctl=lambda fd, *_: self._touch("ioctl", fd), flock=self._flock,
            F_SETFL=4, LOCK_EX=2, LOCK_NB=4, LOCK_UN=8,
        )  # fmt: skip
        return {"os": fake_os, "fcntl": fake_fcntl, "termios": fake_termios, "select": fake_select}

    def open(self, path: str, flags: int) -> int:
        self.calls("open")
        tty = self.ttys.get(path)
        if tty is None or not tty.present:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
        tty.opened += 1
        return self._new(tty)

    def pipe(self) -> tuple[int, int]:
        self.calls("pipe")
        return self._new(None), self._new(None)

    def _new(self, tty: Tty | None) -> int:
        fd = next(DESCRIPTORS)
        self._open[fd] = tty
        return fd

    def close(self, fd: int) -> None:
        if fd not in self._open:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        tty = self._open.pop(fd)
        if tty is not None:
            tty.opened -= 1
            tty.locked = tty.locked and tty.opened > 0
            self.calls("close")  # the descriptor is gone, whatever close says

    def read(self, fd: int, size: int) -> bytes:
        tty = self._tty(fd)
        told = self.calls("read")
        if told is not None:
            return bytes(told)
        if not tty.present:
            return b""  # as of a USB adapter that was unplugged
        data, tty.waiting_bytes = tty.waiting_bytes[:size], tty.waiting_bytes[size:]
        if not data:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        return data

    def write(self, fd: int, data: bytes) -> int:
        tty = self._tty(fd)
        told = self.calls("write")
        if not tty.present:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        if tty.stalled:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        taken = len(data) if told is None else min(int(told), len(data))
        tty.listener(bytes(data[:taken]))
        return taken

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
        ttys = [tty for fd in fds if (tty := self._open.get(fd)) is not None]
        ttys[0].news.wait(end_s - self.time.now_s)

    def readable(self, fd: int) -> bool:
        tty = self._open.get(fd)
        return tty is not None and (bool(tty.waiting_bytes) or not tty.present)

    def writable(self, fd: int) -> bool:
        tty = self._open.get(fd)
        return tty is not None and (not tty.stalled or not tty.present)

    def _tty(self, fd: int) -> Tty:
        tty = self._open.get(fd)
        if tty is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return tty

    def _touch(self, name: str, fd: int) -> int:
        self._tty(fd)
        self.calls(name)
        return 0

    def _flock(self, fd: int, operation: int) -> None:
        tty = self._tty(fd)
        if operation & 8:
            tty.locked = False
            return
        self.calls("flock")
        if tty.locked:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        tty.locked = True

    def _tcgetattr(self, fd: int) -> list[Any]:
        self._touch("tcgetattr", fd)
        return deepcopy(self._tty(fd).settings)

    def _tcsetattr(self, fd: int, _when: int, settings: list[Any]) -> None:
        self._touch("tcsetattr", fd)
        self._tty(fd).settings = deepcopy(settings)

    def _tcflush(self, fd: int, queue: int) -> None:
        self._touch("tcflush", fd)
        if queue == termios.TCIFLUSH:
            self._tty(fd).waiting_bytes = b""


class Poll:
    """`select.poll()` for one descriptor."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._fd, self._mask = -1, 0

    def register(self, fd: int, mask: int) -> None:
        self._fd, self._mask = fd, mask

    def poll(self, timeout_ms: float) -> list[tuple[int, int]]:
        kernel = self._kernel
        told = kernel.calls("poll")
        if told is not None:
            return [(self._fd, int(told))]
        end_s = kernel.time.now_s + timeout_ms / 1000
        ready = kernel.readable if self._mask & select.POLLIN else kernel.writable
        while not ready(self._fd):
            if kernel.time.now_s >= end_s:
                return []
            kernel.sleep([self._fd], end_s)
        return [(self._fd, self._mask)]
