"""Reads files named by people without ever blocking; anything else, such as a pipe, is reported as what it is.

Opening a pipe blocks until somebody writes to it, a device may never end, and opening a serial port disturbs it. So the
type is checked first. Standard library only: an emergency stop also reads its station file this way.
"""

import errno
import os
import stat
from pathlib import Path

#: What a name may refer to instead of a file, by the type in its mode.
OTHERS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe (FIFO)",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def read_plain(path: Path, most: int, wanted: str) -> bytes:
    """The file's content: at most `most` bytes, plus one if there are more. OSError says what is wrong with it.

    `wanted` describes the expected file, for people.
    """
    check_plain(path, wanted)
    fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    try:
        data = bytearray()
        while len(data) <= most and (part := os.read(fd, most + 1 - len(data))):
            data += part
    finally:
        os.close(fd)
    return bytes(data)


def check_plain(path: Path, wanted: str) -> None:
    """OSError unless `path` is a regular file that can be read now."""
    try:
        mode = path.stat().st_mode
    except ValueError:  # a NUL in its name
        raise OSError(errno.ENOENT, os.strerror(errno.ENOENT), str(path)) from None
    if not stat.S_ISREG(mode):
        kind = OTHERS.get(stat.S_IFMT(mode), "no file")
        raise OSError(errno.EINVAL, f"this is {kind}; expected is {wanted}", str(path))
    if not os.access(path, os.R_OK):
        said = f"permission denied for user {os.geteuid()}; expected is {wanted} that this user may read"
        raise OSError(errno.EACCES, said, str(path))
