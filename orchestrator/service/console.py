"""Writes lines for people on standard error, in its own thread: a slow or absent reader delays nothing."""

import io
import os
import select
import sys
import threading
from collections import deque
from contextlib import suppress

from orchestrator.model import Cause
from orchestrator.text.catalogue import say

#: The maximum number of waiting lines; beyond that the oldest are dropped and counted.
BACKLOG = 1000
#: Standard error.
FD = 2


class Console:
    """`say` never blocks. From `start` to `close`, output to `sys.stderr` also goes through here."""

    def __init__(self, fd: int = FD, language: str = "en") -> None:
        self._language = language
        self._fd = fd if sys.__stderr__ is not None else None  # closed at start: by now it may be a charger's port
        self._said: deque[str] = deque()
        self._left_out = 0
        self._lock = threading.Lock()  # guards the lines; never held while writing
        self._wake = threading.Event()
        self._ended = False
        self._before = sys.stderr
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()
        self._before, sys.stderr = sys.stderr, _Stream(self)

    def say(self, text: str) -> None:
        """Queue one or more lines."""
        with self._lock:
            self._said.append(text)
            if len(self._said) > BACKLOG:
                self._said.popleft()
                self._left_out += 1
        self._wake.set()

    def close(self, within_s: float = 1.0) -> None:
        """Write what is left and end; lines not read by then are lost."""
        self._ended = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(within_s)
        elif self._said:  # it could not be started: better here than not at all
            self._run()
        sys.stderr = self._before

    def _run(self) -> None:
        while True:
            self._wake.wait()
            self._wake.clear()
            ended = self._ended
            while text := self._next():
                if self._fd is not None:
                    with suppress(OSError):  # there need not be a reader
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
        except BlockingIOError:  # another process sharing the descriptor may have made it non-blocking
            select.select([], [fd], [])


class _Stream(io.TextIOBase):
    """Replaces `sys.stderr`: tracebacks and warnings must not wait for a reader either."""

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
