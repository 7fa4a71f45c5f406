"""The unchanged service on a disk that hangs after SIGUSR1: `python -m tests.whole.worn CALL [FD] STATION`.

CALL is the system call that stops returning, for the store and the journal; with "now-" before it it never returns.
Without FD it is the guardian, and starts itself as its controller.
"""

import os
import signal
import sys
import threading

from orchestrator.lastresort import guardian
from orchestrator.service import controller, disk, loading, packed, parts, rotating

ARMED = threading.Event()


class Worn:
    """`os`, except for one call."""

    def __init__(self, call: str) -> None:
        self._call = call.removeprefix("now-")
        if self._call != call:
            ARMED.set()

    def __getattr__(self, name: str) -> object:
        if name == self._call and ARMED.is_set():
            threading.Event().wait()
        return getattr(os, name)


if __name__ == "__main__":
    call, *arguments = sys.argv[1:]
    if len(arguments) == 1:
        sys.exit(guardian.guard(arguments, ("-m", "tests.whole.worn", call)))
    hangs = Worn(call)
    for module in (disk, loading, packed, parts, rotating):  # their whole disk
        module.os = hangs  # type: ignore[attr-defined]
    signal.signal(signal.SIGUSR1, lambda *_: ARMED.set())
    sys.exit(controller.main(int(arguments[0]), arguments[1]))
