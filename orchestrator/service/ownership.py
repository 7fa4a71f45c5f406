"""Ownership of a journal's directory: only the service that holds the lock in it may write there."""

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from orchestrator.service.disk import lock_file, make_directory

LOCK = "lock"
#: How long a service that was just killed may still hold the lock.
LOCKED_S = 1.5


class Ownership:
    """The lock of one directory, which is created if missing. `clock` is monotonic."""

    def __init__(self, directory: Path, clock: Callable[[], float]) -> None:
        self._directory, self._clock = directory, clock
        self._descriptor: int | None = None

    def take(self, ended: Callable[[], bool]) -> None:
        """Become the only service that writes here; BlockingIOError if another one keeps the lock."""
        if self._descriptor is not None:
            return
        make_directory(self._directory)
        end_s, pause = self._clock() + LOCKED_S, threading.Event()
        while self._descriptor is None:
            try:
                self._descriptor = lock_file(self._directory / LOCK)
            except BlockingIOError:
                if self._clock() > end_s or ended():
                    raise
                pause.wait(0.05)

    def give_up(self) -> None:
        """Release the lock."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            with suppress(OSError):  # it is closed anyway
                os.close(descriptor)
