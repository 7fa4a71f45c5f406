"""`python -m tests.guest.breaker WHAT FD STATION`: the unchanged controller, with one break on SIGUSR1.

WHAT is a name in BREAKS.
"""

import ctypes
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from orchestrator.service import controller


def _is_bus(fd: int) -> bool:
    with suppress(OSError):
        copy = socket.socket(fileno=os.dup(fd))
        with copy:
            return copy.family == socket.AF_CAN
    return False


def close_all(is_meant: Callable[[int], bool]) -> None:
    for fd in [int(path.name) for path in Path("/proc/self/fd").iterdir()]:
        if fd > 2 and is_meant(fd):
            os.close(fd)


def end_bus_threads() -> None:
    for thread in threading.enumerate():
        if thread.name.startswith("can-"):
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(SystemExit))


BREAKS: dict[str, Callable[[], None]] = {
    "serial ports are closed": partial(close_all, os.isatty),
    "CAN sockets are closed": partial(close_all, _is_bus),
    "CAN threads end": end_bus_threads,
}

if __name__ == "__main__":
    what, link, station = sys.argv[1:]
    signal.signal(signal.SIGUSR1, lambda *_: BREAKS[what]())
    sys.exit(controller.main(int(link), station))
