"""Files that people name, read without ever waiting: what is no file, but a pipe, say, is told for what it is.

Opening a pipe waits for whoever writes into it, a device may never end, and a serial port is disturbed by being opened.
So it is looked first. Standard library only: an emergency stop reads its station file by this, too.
"""

import errno
import os
import stat
from pathlib import Path

#: What a name may stand for instead of a file, by the type in its mode.
OTHERS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe (FIFO)",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def read_plain(path: Path, most: int, wanted: str) -> bytes:
    """What is in it: at most `most` bytes, and one more if there are more. OSError says what is wrong with it.

    `wanted` is what was expected there, for people.
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
    """OSError where `path` is no file that can be read now."""
    try:
        mode = path.stat().st_mode
    except ValueError:  # a 0 in its name
        raise OSError(errno.ENOENT, os.strerror(errno.ENOENT), str(path)) from None
    if not stat.S_ISREG(mode):
        kind = OTHERS.get(stat.S_IFMT(mode), "no file")
        raise OSError(errno.EINVAL, f"this is {kind}; expected is {wanted}", str(path))
    if not os.access(path, os.R_OK):
        said = f"permission denied for user {os.geteuid()}; expected is {wanted} that this user may read"
        raise OSError(errno.EACCES, said, str(path))
