"""A disk in memory: what processes see (the page cache), and what survives a power cut.

Only fsync makes files and directories durable, each separately: a file's bytes by its own fsync, its name by that of
the directory. A power cut leaves what is durable, plus whatever the file system may have written meanwhile: nothing,
everything, the first part, or any selection in any order, with torn writes.
"""

import errno
import os
import posixpath
import stat
from dataclasses import dataclass, field
from random import Random
from types import SimpleNamespace

#: A write can be torn at these.
SECTOR = 512


@dataclass(slots=True, eq=False)
class Inode:
    """One file, as seen by processes and as stored on the disk."""

    number: int
    data: bytearray = field(default_factory=bytearray)
    kept: bytes = b""
    lock: object = None  #: the open file that has it locked


@dataclass(frozen=True, slots=True)
class Change:
    """A change not durable yet: a write, a new length, or names (path → file, None: removed)."""

    inode: Inode | None = None
    at: int = 0
    data: bytes = b""
    size: int | None = None
    names: tuple[tuple[str, Inode | None], ...] = ()


def fails(number: int, path: str) -> OSError:
    return OSError(number, os.strerror(number), path)


class Disk:
    """All files below the directories that exist from the start."""

    def __init__(self, *directories: str) -> None:
        self.names: dict[str, Inode] = {}
        self.directories = set(directories)
        self._kept_names: dict[str, Inode] = {}
        self._pending: list[Change] = []
        self._count = 0

    # --- what processes do --------------------------------------------------------------------------------------------

    def open(self, path: str, flags: int) -> Inode:
        inode = self.names.get(path)
        if inode is None:
            if path in self.directories:
                return Inode(0)
            if not flags & os.O_CREAT:
                raise fails(errno.ENOENT, path)
            self._parent(path)
            self._count += 1
            inode = Inode(self._count)
            self._name((path, inode))
        elif flags & os.O_CREAT and flags & os.O_EXCL:
            raise fails(errno.EEXIST, path)
        if flags & os.O_TRUNC:
            self.truncate(inode, 0)
        return inode

    def write(self, inode: Inode, at: int, data: bytes) -> None:
        inode.data[len(inode.data) :] = bytes(max(0, at - len(inode.data)))
        inode.data[at : at + len(data)] = data
        self._pending.append(Change(inode, at, data))

    def truncate(self, inode: Inode, size: int) -> None:
        if size != len(inode.data):
            inode.data[:] = inode.data[:size].ljust(size, b"\0")
            self._pending.append(Change(inode, size=size))

    def sync(self, inode: Inode) -> None:
        """fsync of a file: its bytes, not its name."""
        self._pending = [change for change in self._pending if change.inode is not inode]
        inode.kept = bytes(inode.data)

    def sync_directory(self, path: str) -> None:
        """fsync of a directory: the names in it."""
        left = []
        for change in self._pending:
            if change.names and any(posixpath.dirname(name) == path for name, _ in change.names):
                self._apply(change)
            else:
                left.append(change)
        self._pending = left

    def rename(self, old: str, new: str) -> None:
        if old in self.directories:  # durable at once, like its creation
            self.directories.remove(old)
            self.directories.add(new)
            return
        if new in self.directories:
            raise fails(errno.EISDIR, new)
        inode = self.names.get(old)
        if inode is None:
            raise fails(errno.ENOENT, old)
        self._parent(new)
        if old != new:
            self._name((new, inode), (old, None))

    def unlink(self, path: str) -> None:
        if path not in self.names:
            raise fails(errno.ENOENT, path)
        self._name((path, None))

    def mkdir(self, path: str) -> None:
        if path in self.directories or path in self.names:
            raise fails(errno.EEXIST, path)
        self._parent(path)
        self.directories.add(path)  # durable at once: a station's directory is not created in its last second

    def listdir(self, path: str) -> list[str]:
        if path not in self.directories:
            raise fails(errno.ENOENT, path)
        below = (*self.names, *self.directories)
        return sorted(posixpath.basename(name) for name in below if posixpath.dirname(name) == path)

    def stat(self, path: str) -> SimpleNamespace:
        if path in self.directories:
            return _stat(stat.S_IFDIR | 0o750, 0, 1 << 20)
        inode = self.names.get(path)
        if inode is None:
            raise fails(errno.ENOENT, path)
        return self.fstat(inode)

    def fstat(self, inode: Inode) -> SimpleNamespace:
        return _stat(stat.S_IFREG | 0o600, len(inode.data), inode.number)

    def _parent(self, path: str) -> None:
        if posixpath.dirname(path) not in self.directories:
            raise fails(errno.ENOENT, path)

    def _name(self, *names: tuple[str, Inode | None]) -> None:
        change = Change(names=names)
        _rename(self.names, change)
        self._pending.append(change)

    # --- what others do to it ----------------------------------------------------------------------------------------

    def damage(self, path: str, how: str) -> None:
        """A person or a bad card has changed a file to this, durably."""
        inode = self.names.get(path)
        if inode is None:
            return
        if how == "directory":
            for names in (self.names, self._kept_names):
                names.pop(path, None)
            self.directories.add(path)
            return
        data = bytes(inode.data)
        inode.data[:] = {
            "empty": b"",
            "truncated": data[: len(data) // 2],
            "zeros": bytes(len(data)),
            "another": b'{"format": 99}\n',
        }[how]
        self.sync(inode)

    # --- what a power cut does ----------------------------------------------------------------------------------------

    def cut(self, dice: Random, how: str = "") -> str:
        """The power fails; the argument says what the file system had written by then (default: random)."""
        how = how or dice.choice(("nothing more", "everything", "the first part", "some of it", "some of it, torn"))
        pending = self._pending
        chosen: dict[str, list[Change]] = {
            "nothing more": [],
            "everything": pending,
            "the first part": pending[: dice.randint(0, len(pending))],
            "some of it": [change for change in pending if dice.random() < 0.5],
            "some of it, torn": [_torn(change, dice) for change in pending if dice.random() < 0.7],
        }
        for change in chosen[how]:
            self._apply(change)
        self._pending = []
        self.names = {}
        for path, inode in self._kept_names.items():  # files open before are not those opened afterwards
            self._count += 1
            self.names[path] = Inode(self._count, bytearray(inode.kept), inode.kept)
        self._kept_names = dict(self.names)
        return how

    def _apply(self, change: Change) -> None:
        if change.names:
            _rename(self._kept_names, change)
        elif change.inode is not None:
            kept = change.inode.kept
            if change.size is not None:
                change.inode.kept = kept[: change.size].ljust(change.size, b"\0")
            else:
                kept = kept.ljust(change.at, b"\0")
                change.inode.kept = kept[: change.at] + change.data + kept[change.at + len(change.data) :]


def _rename(names: dict[str, Inode], change: Change) -> None:
    for path, inode in change.names:
        if inode is None:
            names.pop(path, None)
        else:
            names[path] = inode


def _torn(change: Change, dice: Random) -> Change:
    if not change.data or dice.random() < 0.5:
        return change
    length = dice.randrange(len(change.data) + 1)
    length -= length % SECTOR if dice.random() < 0.5 else 0
    return Change(change.inode, change.at, change.data[:length])


def _stat(mode: int, size: int, number: int) -> SimpleNamespace:
    return SimpleNamespace(
        st_mode=mode, st_size=size, st_ino=number, st_dev=1, st_uid=os.getuid(), st_gid=os.getgid(), st_nlink=1,
        st_mtime=0.0, st_atime=0.0, st_ctime=0.0,
    )  # fmt: skip
