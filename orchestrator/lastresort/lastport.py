"""A charger's port in a last-resort process: opened on demand, written without blocking, queried, closed.

Standard library only, few imports.
"""

import errno
import os
import select
import termios
import time
from contextlib import suppress

from orchestrator.lastresort import line_settings
from orchestrator.lastresort.bareport import drop_port, flush, open_port, takes
from orchestrator.lastresort.port_owner import holder
from orchestrator.protocol.standby import ANSWER_BYTES, QUESTION, stands_by

#: The reply deadline used elsewhere (120 ms), plus a margin.
ANSWER_S = 0.2
#: From an answer's first byte to its last, with an adapter's latency: reading earlier yields fragments, or leaves some
#: to another process that reads this port.
GATHER_S = 0.01 + ANSWER_BYTES * 10 / 19200
#: How many received bytes are kept; far more than one answer.
KEEP = 256

STALLED = "the line takes nothing"
GONE = "the line is gone"


class LastPort:
    """One port by name; `trouble` says what went wrong in its last use. A failing port never raises."""

    def __init__(self, name: str, fd: int | None, *, leave_held: bool) -> None:
        self.name, self.trouble = name, ""
        self._fd, self._leave_held = fd, leave_held
        self._stalled = False  # it took nothing, and no byte has arrived since

    @property
    def is_open(self) -> bool:
        """Whether there is a descriptor."""
        return self._fd is not None

    def never_wait(self) -> None:
        """Make an inherited descriptor non-blocking."""
        if self._fd is not None:
            os.set_blocking(self._fd, False)

    def open(self) -> bool:
        """Open it by name."""
        self.trouble = ""
        try:
            self._fd = open_port(self.name, leave_held=self._leave_held)
        except OSError as error:
            self._failed(error)
        return self.is_open

    def write(self, frame: bytes) -> bool:
        """Write without blocking. If the line is full, its old output is dropped: an old command must not go out."""
        if self._fd is None:
            return False
        self.trouble = ""
        try:
            if not takes(self._fd, frame):
                flush(self._fd, termios.TCOFLUSH)
                if not takes(self._fd, frame):
                    self.trouble, self._stalled = STALLED, True
        except OSError as error:
            self._failed(error)
        return not self.trouble

    def restored(self) -> bool:
        """Whether the port's settings had to be corrected."""
        with suppress(OSError, termios.error):  # gone, or not a tty: its next use will show that
            return self._fd is not None and bool(line_settings.restore(self._fd))
        return False

    def ask(self) -> bool | None:
        """Whether the charger reports standby; None for silence. Bytes received before the question prove nothing."""
        heard, end_s = b"", time.monotonic() + ANSWER_S
        if self._fd is not None:
            flush(self._fd, termios.TCIFLUSH)
            self.write(QUESTION)
        while self._fd is not None and (left_s := end_s - time.monotonic()) > 0:
            listener = select.poll()
            listener.register(self._fd, select.POLLIN)
            if not listener.poll(left_s * 1000):
                break
            time.sleep(GATHER_S)
            if not listener.poll(0):
                continue  # another process has read it: read() would return nothing, as of a line that is gone
            heard = (heard + self._read(self._fd))[-KEEP:]
            standby = stands_by(heard)
            if standby is not None:
                return standby
        return None

    def _read(self, fd: int) -> bytes:
        try:
            data = os.read(fd, 4096)
            if not data:
                raise OSError(GONE)
        except OSError as error:
            self._failed(error)
            return b""
        self._stalled = False
        return data

    def _failed(self, error: OSError) -> None:
        if error.errno == errno.EBUSY:
            owner = holder(self.name, (os.getpid(),))
            self.trouble = f"one program has this port for itself alone (TIOCEXCL): {owner}"
        else:
            self.trouble = error.strerror or str(error)
        self.close()

    def close(self) -> None:
        """Close the port. A stalled line's output is dropped, since close() would wait for it."""
        if self._fd is not None:
            fd, self._fd = self._fd, None
            if self._stalled:
                drop_port(fd)
                return
            with suppress(OSError):  # it is closed anyway
                os.close(fd)
