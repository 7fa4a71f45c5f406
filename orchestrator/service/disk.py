"""Files that are on the disk once a call has returned, not just on their way. Every call may raise OSError, or hang.

A name that was renamed, or made, is on the disk only when its directory is; so that one is synchronised, too.
"""
# ruff: noqa: PTH102, PTH105 - the kernel's own calls, one after another: each of them may be the one that hangs

import errno
import fcntl
import os
from pathlib import Path


def code_of(error: OSError) -> str:
    """What the operating system says, as the catalogue's word for it: "ENOSPC"."""
    return errno.errorcode.get(error.errno or 0, str(error))


def make_directory(directory: Path) -> None:
    """Make it, and what is missing above it, for good."""
    try:
        os.mkdir(directory, 0o750)
    except FileExistsError:
        return
    except FileNotFoundError:
        make_directory(directory.parent)
        os.mkdir(directory, 0o750)
    sync_directory(directory.parent)


def sync_directory(directory: Path) -> None:
    """Bring the names in it to the disk."""
    fd = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    except OSError as error:
        if error.errno != errno.EINVAL:  # this file system has no such thing
            raise
    finally:
        os.close(fd)


def replace_file(path: Path, data: bytes) -> None:
    """Put `data` in the place of what is there, as a whole: after a power cut it is one or the other."""
    fresh = path.with_name(f"{path.name}.new")
    fd = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NONBLOCK, 0o640)
    try:
        while data:
            data = data[os.write(fd, data) :]
        os.fsync(fd)
    finally:
        os.close(fd)
    os.replace(fresh, path)
    sync_directory(path.parent)


def read_file(path: Path, most: int) -> bytes:
    """All of it; OSError (EFBIG) where it has more than `most` bytes."""
    fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        parts = [part := os.read(fd, most + 1)]
        while part and sum(map(len, parts)) <= most:
            parts.append(part := os.read(fd, most + 1))
    finally:
        os.close(fd)
    data = b"".join(parts)
    if len(data) > most:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(path))
    return data


def lock_file(path: Path) -> int:
    """Lock it for as long as the descriptor is open; BlockingIOError where another process has locked it."""
    fd = os.open(path, os.O_RDWR | os.O_CREAT, 0o640)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(fd)
        raise
    return fd
