"""File operations that are on disk once they return. Every call may raise OSError, or hang.

A new or renamed file is on disk only once its directory is; so the directory is synced as well.
"""
# ruff: noqa: PTH102, PTH105 - the kernel's own calls, one by one: each of them may be the one that hangs

import errno
import fcntl
import os
from pathlib import Path


def code_of(error: OSError) -> str:
    """What the operating system says, as the catalogue's word for it: "ENOSPC"."""
    return errno.errorcode.get(error.errno or 0, str(error))


def make_directory(directory: Path) -> None:
    """Make it and its missing parents, durably."""
    try:
        os.mkdir(directory, 0o750)
    except FileExistsError:
        return
    except FileNotFoundError:
        make_directory(directory.parent)
        os.mkdir(directory, 0o750)
    sync_directory(directory.parent)


def sync_directory(directory: Path) -> None:
    """Sync the names in it to disk."""
    fd = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    except OSError as error:
        if error.errno != errno.EINVAL:  # the file system does not support it
            raise
    finally:
        os.close(fd)


def replace_file(path: Path, data: bytes) -> None:
    """Replace the file's content atomically: after a power cut it is the old or the new one."""
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
    """The whole content; OSError (EFBIG) if it exceeds `most` bytes."""
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
    """Lock it for as long as the descriptor is open; BlockingIOError if another process has locked it."""
    fd = os.open(path, os.O_RDWR | os.O_CREAT, 0o640)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(fd)
        raise
    return fd
