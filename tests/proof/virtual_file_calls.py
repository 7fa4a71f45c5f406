"""Files, directories and ports of the virtual kernel: open, read, write, rename, stat."""

import errno
import os
import posixpath
from collections.abc import Callable
from math import inf
from types import SimpleNamespace
from typing import Any

from tests.proof.virtual_descriptors import ROOT
from tests.proof.virtual_disk import Inode, fails
from tests.proof.virtual_files import File
from tests.proof.virtual_tty import Tty
from tests.proof.virtual_tty_calls import TtyCalls


def real(name: str) -> Callable[..., Any]:
    """The real kernel's call, for paths and descriptors that are not ours."""
    return getattr(os, name)  # type: ignore[no-any-return]


class FileCalls(TtyCalls):
    """The calls of `os` for files, directories and ports."""

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
                raise fails(errno.ENOENT, name)  # a missing adapter
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
            return b""  # as for an unplugged USB adapter
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

    def _truncate(self, path: Any, size: int) -> None:
        fd = self.open(path, os.O_WRONLY)
        try:
            self.ftruncate(fd, size)
        finally:
            self.close(fd)

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
