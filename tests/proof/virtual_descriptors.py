"""Descriptors of the virtual kernel and their processes."""

import errno
import os
from collections.abc import Callable
from itertools import count
from typing import Any

from tests.proof.virtual_calls import Calls
from tests.proof.virtual_disk import Disk, Inode
from tests.proof.virtual_files import File, Proc, Socket, Stream
from tests.proof.virtual_gpio import Chip, Output
from tests.proof.virtual_time import Time
from tests.proof.virtual_tty import Tty

#: Our descriptors; the others are the real kernel's. Numbers are never reused: a leftover of an earlier world that
#: closes its port when garbage-collected must not close one of this world's.
DESCRIPTORS = count(100_001)
#: Paths below it are ours; others are the real kernel's.
ROOT = "/virtual/"
STDOUT, STDERR = 1, 2


class Descriptors:
    """Open descriptors by process; an open file may have several."""

    def __init__(self, time: Time, disk: Disk | None = None) -> None:
        self.time = time
        self.calls = Calls(time)
        self.ttys: dict[str, Tty] = {}
        self.chips: dict[str, Chip] = {}
        self.clock_off_s = 0.0  #: the wall clock was set
        self.disk = disk or Disk(ROOT.rstrip("/"))
        self.output = {STDOUT: Stream(time), STDERR: Stream(time)}
        self.on_said: Callable[[Any, str], None] = lambda _process, _text: None
        self.proc = Proc()
        self._open: dict[int, tuple[File, set[Any]]] = {}  # the file and the descriptor's process

    def add(self, path: str) -> Tty:
        self.ttys[path] = Tty(self.time)
        return self.ttys[path]

    @property
    def me(self) -> Any:
        return self.time.me().process

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
            self.calls("close", file.path)  # the descriptor is gone, whatever close returns

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
        """The process died: close its descriptors."""
        for fd in [fd for fd, (_, owners) in self._open.items() if process in owners]:
            self._drop(fd, process)

    def new_line(self, name: str, output: Output) -> int:
        """The descriptor of a requested line."""
        return self._new(File(name, output))

    def is_ours(self, path: Any) -> bool:
        return isinstance(path, str) and path.startswith(ROOT)
