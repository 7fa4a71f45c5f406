"""Other programs that use a charger's port: each a process of its own, as on a real machine; and other users."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

_HOLD = """
import fcntl, os, sys, termios
fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
if sys.argv[2] == "flock":
    fcntl.flock(fd, fcntl.LOCK_EX)
elif sys.argv[2] == "TIOCEXCL":
    fcntl.ioctl(fd, termios.TIOCEXCL)
print(flush=True)
sys.stdin.read()
"""


@contextmanager
def holding(port: str, how: str = "flock", name: str = sys.executable) -> Iterator["subprocess.Popen[bytes]"]:
    """A program with the port open and locked by "flock" or "TIOCEXCL"; `name` is its command name."""
    process = subprocess.Popen(
        [name, "-c", _HOLD, port, how], executable=sys.executable, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout is not None
    process.stdout.readline()
    try:
        yield process
    finally:
        process.communicate()


def stty(port: str, *words: str) -> None:
    """Like a person, or a program that opens the port itself."""
    subprocess.run(["stty", "-F", port, *words], check=True, capture_output=True)


@contextmanager
def somebody_else() -> Iterator[None]:
    """Root may open anything, so be nobody for a while."""
    before = os.geteuid()
    if before == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(before)
