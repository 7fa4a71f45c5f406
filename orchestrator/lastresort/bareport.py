"""A charger's port on a bare file descriptor: opened for a stop, written without blocking. Standard library only."""

import fcntl
import os
import termios
from contextlib import suppress

from orchestrator.lastresort import line_settings
from orchestrator.lastresort.port_owner import holder

HELD = "left alone: a service holds this port"


def open_port(name: str, *, leave_held: bool) -> int:
    """Open a charger's port for stopping, without blocking and with the right settings; returns the descriptor.

    `leave_held`: only if no orchestrator has locked it; it is then locked for us. Anybody else's lock blocks no stop.
    OSError says why the port could not be opened.
    """
    try:
        fd = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except ValueError:  # a NUL, or a lone surrogate: a dying controller may send anything
        raise OSError("not the name of a port") from None
    try:
        line_settings.take_back(fd)  # with another line discipline a serial port may not look like one
        if not os.isatty(fd):
            raise OSError("not a serial port")
        if leave_held:
            _lock(fd, name)
        line_settings.restore(fd)
    except termios.error:
        return fd  # its settings may still be right
    except OSError:
        os.close(fd)
        raise
    return fd


def _lock(fd: int, name: str) -> None:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        if holder(name, (os.getpid(),)).ours:  # our own process has it open, but does not hold the lock
            raise OSError(HELD) from None


def drop_port(fd: int) -> None:
    """Close a port that is given up. Unsent output is dropped: close() would wait for a stalled line."""
    flush(fd, termios.TCOFLUSH)
    with suppress(OSError):
        os.close(fd)


def takes(fd: int, frame: bytes) -> bool:
    """Write a frame; whether the line took all of it."""
    try:
        return os.write(fd, frame) == len(frame)
    except BlockingIOError:
        return False


def flush(fd: int, queue: int) -> None:
    """Drop the content of one of its queues."""
    with suppress(termios.error):  # gone; its next use will show that
        termios.tcflush(fd, queue)
