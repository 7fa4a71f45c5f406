"""A charger's port on a bare file descriptor: opened for a stop, written to without waiting. Standard library only."""

import fcntl
import os
import termios
from contextlib import suppress

from orchestrator.lastresort import line_settings
from orchestrator.lastresort.port_owner import holder

HELD = "left alone: a service holds this port"


def open_port(name: str, *, leave_held: bool) -> int:
    """Open a charger's port for stopping: without waiting, and with its settings; the descriptor.

    `leave_held`: only if no orchestrator holds it, by the lock that one puts on it; then it is held. Anybody else's
    lock keeps no stop away. OSError says why not.
    """
    try:
        fd = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except ValueError:  # a 0, or half a character: a dying controller may say anything
        raise OSError("not the name of a port") from None
    try:
        line_settings.take_back(fd)  # with another line discipline a serial port may not look like one
        if not os.isatty(fd):
            raise OSError("not a serial port")
        if leave_held:
            _lock(fd, name)
        line_settings.restore(fd)
    except termios.error:
        return fd  # its settings may be right all the same
    except OSError:
        os.close(fd)
        raise
    return fd


def _lock(fd: int, name: str) -> None:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        if holder(name, (os.getpid(),)).ours:  # we have it open ourselves, and hold nothing
            raise OSError(HELD) from None


def drop_port(fd: int) -> None:
    """Close a port that is given up. What it has not sent is dropped: close() would wait for a line that is stalled."""
    flush(fd, termios.TCOFLUSH)
    with suppress(OSError):
        os.close(fd)


def takes(fd: int, frame: bytes) -> bool:
    """Whether a line has taken the whole frame."""
    try:
        return os.write(fd, frame) == len(frame)
    except BlockingIOError:
        return False


def flush(fd: int, queue: int) -> None:
    """Drop what is in one of its queues."""
    with suppress(termios.error):  # gone; the next use of it will tell
        termios.tcflush(fd, queue)
