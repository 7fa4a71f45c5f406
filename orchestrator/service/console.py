"""What people read: lines on standard error, from a thread of its own. Who reads slowly, or not, delays nobody."""

import io
import os
import select
import sys
import threading
from collections import deque
from contextlib import suppress

from orchestrator.model import Cause
from orchestrator.text.catalogue import say

#: Lines that wait for somebody to read; of more than that the oldest go, and are counted.
BACKLOG = 1000
#: Standard error.
FD = 2


class Console:
    """`say` never waits. From `start` to `close`, whoever prints to `sys.stderr` says it here, too."""

    def __init__(self, fd: int = FD, language: str = "en") -> None:
        self._language = language
        self._fd = fd if sys.__stderr__ is not None else None  # started without: by now that may be a charger's port
        self._said: deque[str] = deque()
        self._left_out = 0
        self._lock = threading.Lock()  # guards the lines; nobody writes with it
        self._wake = threading.Event()
        self._ended = False
        self._before = sys.stderr
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._before, sys.stderr = sys.stderr, _Stream(self)
        self._thread.start()

    def say(self, text: str) -> None:
        """A line, or several."""
        with self._lock:
            self._said.append(text)
            if len(self._said) > BACKLOG:
                self._said.popleft()
                self._left_out += 1
        self._wake.set()

    def close(self, within_s: float = 1.0) -> None:
        """Write what is left and end; who does not read by then does not learn of it."""
        self._ended = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(within_s)
        sys.stderr = self._before

    def _run(self) -> None:
        while True:
            self._wake.wait()
            self._wake.clear()
            ended = self._ended
            while text := self._next():
                if self._fd is not None:
                    with suppress(OSError):  # nobody has to listen
                        _write(self._fd, f"{text}\n".encode(errors="backslashreplace"))
            if ended:
                return

    def _next(self) -> str:
        with self._lock:
            left_out, self._left_out = self._left_out, 0
            if left_out:
                return say(Cause.of("lines_left_out", lines=left_out), self._language)
            return self._said.popleft() if self._said else ""


def _write(fd: int, data: bytes) -> None:
    while data:
        try:
            data = data[os.write(fd, data) :]
        except BlockingIOError:  # whoever shares it may have made it so
            select.select([], [fd], [])


class _Stream(io.TextIOBase):
    """In the place of `sys.stderr`: a traceback, say, or a warning, must not wait for a reader either."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._part = ""

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        *lines, self._part = (self._part + text).split("\n")
        for line in filter(None, lines):
            self._console.say(line)
        return len(text)
