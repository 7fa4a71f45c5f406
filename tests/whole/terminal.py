"""A program on a terminal of a given size: what its screen shows, and whether it ever wrapped a line or scrolled."""

import codecs
import fcntl
import os
import pty
import re
import select
import signal
import struct
import sys
import termios
from collections.abc import Mapping
from typing import Self

from orchestrator.columns import width_of
from tests.waiting import wait_until
from tests.whole.station import die_with_parent

#: What the product may write: colours, to the first line, clear this line, clear all below; or any letter.
TOKEN = re.compile(r"\x1b\[(?P<args>[\d;]*)(?P<code>[mHKJ])|(?P<letter>[^\x1b])", re.DOTALL)
#: The beginning of a code at the end of what has come so far.
HALF = re.compile(r"\x1b[^a-zA-Z]*\Z")


class Screen:
    """As many lines and columns as a terminal has; double-width letters take two columns."""

    def __init__(self, lines: int, columns: int) -> None:
        self.height, self.width = lines, columns
        self.lines = [""] * lines
        self.wrapped = self.scrolled = 0
        self.codes: list[str] = []  #: the colours that were set
        self._line = 0
        self._column = 0

    def write(self, text: str) -> None:
        for token in TOKEN.finditer(text):
            if token["letter"]:
                self._letter(token["letter"])
            elif token["code"] == "m":
                self.codes.append(token["args"])
            elif token["code"] == "H":
                self._line = self._column = 0
            elif token["code"] == "K":
                self._keep(self._column)
            else:
                self._keep(self._column)
                self.lines[self._line + 1 :] = [""] * (self.height - self._line - 1)

    def _letter(self, letter: str) -> None:
        if letter == "\r":
            self._column = 0
        elif letter == "\n":
            self._down()
        else:
            if self._column + width_of(letter) > self.width:
                self.wrapped += 1
                self._column = 0
                self._down()
            self._keep(self._column)
            self.lines[self._line] += letter
            self._column += width_of(letter)

    def _keep(self, columns: int) -> None:
        """Forget what stood here from this column on: nothing is ever written in the midst of a line."""
        line = self.lines[self._line]
        while width_of(line) > columns:
            line = line[:-1]
        self.lines[self._line] = line

    def _down(self) -> None:
        if self._line + 1 < self.height:
            self._line += 1
            return
        self.scrolled += 1
        self.lines = [*self.lines[1:], ""]


class Terminal:
    """`with Terminal(16, 60, "status", "--watch") as terminal:`."""

    def __init__(self, lines: int, columns: int, *words: str, env: Mapping[str, str]) -> None:
        self.screen = Screen(lines, columns)
        self._argv = [sys.executable, "-m", "orchestrator", *words]
        self._env = {**os.environ, "TERM": "xterm", **env}
        for name in ("LINES", "COLUMNS", "NO_COLOR"):
            if name not in env:
                self._env.pop(name, None)
        self._heard = ""
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")

    def __enter__(self) -> Self:
        self.pid, self._fd = pty.fork()
        if not self.pid:
            die_with_parent()
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("4H", self.screen.height, self.screen.width, 0, 0))
            os.execve(sys.executable, self._argv, self._env)
        return self

    def wait_for(self, text: str, within_s: float = 20.0) -> None:
        """Until the screen shows it."""
        try:
            wait_until(lambda: text in self.shown(), within_s, text)
        except AssertionError:
            raise AssertionError(f"{text!r} is not on the screen:\n{self.shown()}") from None

    def shown(self) -> str:
        """What is on the screen now."""
        self._read(0.05)
        return "\n".join(self.screen.lines)

    def end(self, keys: bytes = b"") -> int:
        """Type these keys, and wait for the end; returns the exit status."""
        if keys:
            os.write(self._fd, keys)
        while self._read(10.0):
            pass
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def _read(self, within_s: float) -> bool:
        """Whether there was anything."""
        if not select.select([self._fd], [], [], within_s)[0]:
            return False
        try:
            data = os.read(self._fd, 1 << 16)
        except OSError:  # the program has ended
            return False
        self._heard += self._decoder.decode(data)
        half = HALF.search(self._heard)
        whole = self._heard[: half.start()] if half else self._heard
        self._heard = self._heard[len(whole) :]
        self.screen.write(whole)
        return True

    def __exit__(self, *_: object) -> None:
        try:
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
        except (ProcessLookupError, ChildProcessError):
            pass
        os.close(self._fd)
