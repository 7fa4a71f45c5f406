"""`python -m tests.guest.closer WHICH FD STATION`: the unchanged controller, whose files are closed on SIGUSR1.

WHICH is `ports`, the serial ports, or `buses`, the CAN sockets.
"""

import os
import signal
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from orchestrator.service import controller


def _is_bus(fd: int) -> bool:
    with suppress(OSError):
        copy = socket.socket(fileno=os.dup(fd))
        with copy:
            return copy.family == socket.AF_CAN
    return False


WHICH: dict[str, Callable[[int], bool]] = {"ports": os.isatty, "buses": _is_bus}


def close_all(is_meant: Callable[[int], bool]) -> None:
    for fd in [int(path.name) for path in Path("/proc/self/fd").iterdir()]:
        if fd > 2 and is_meant(fd):
            os.close(fd)


if __name__ == "__main__":
    which, link, station = sys.argv[1:]
    signal.signal(signal.SIGUSR1, lambda *_: close_all(WHICH[which]))
    sys.exit(controller.main(int(link), station))
