"""A charger's port in a process of last resort: opened when it is needed, written to without waiting, asked, closed.

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

#: An answer takes as long as anywhere else (120 ms), and a bit.
ANSWER_S = 0.2
#: From an answer's first byte to its last, with an adapter's latency: who reads earlier gets pieces, or leaves some to
#: another process that reads this port.
GATHER_S = 0.01 + ANSWER_BYTES * 10 / 19200
#: Of what came in, kept up to this; far more than one answer.
KEEP = 256

STALLED = "the line takes nothing"
GONE = "the line is gone"


class LastPort:
    """One port by its name; `trouble` is what went wrong in the last use of it. Never raises for what a port does."""

    def __init__(self, name: str, fd: int | None, *, leave_held: bool) -> None:
        self.name, self.trouble = name, ""
        self._fd, self._leave_held = fd, leave_held
        self._stalled = False  # since then nothing has come in

    @property
    def is_open(self) -> bool:
        """There is a descriptor."""
        return self._fd is not None

    def never_wait(self) -> None:
        """For a descriptor of somebody else's, which may be one that waits."""
        if self._fd is not None:
            os.set_blocking(self._fd, False)

    def open(self) -> bool:
        """Open it by its name."""
        self.trouble = ""
        try:
            self._fd = open_port(self.name, leave_held=self._leave_held)
        except OSError as error:
            self._failed(error)
        return self.is_open

    def write(self, frame: bytes) -> bool:
        """Write what the line takes now. What a full line still holds is dropped: an old order must not come out."""
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
        """Whether the port's settings had to be set right."""
        with suppress(OSError, termios.error):  # gone, or no tty: the next use of it will tell
            return self._fd is not None and bool(line_settings.restore(self._fd))
        return False

    def ask(self) -> bool | None:
        """Whether the charger says that it stands by; None for silence. What came in before it proves nothing."""
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
        except BlockingIOError:
            return b""  # somebody else has read it
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
        """Close the port. What a stalled line has not taken is dropped, since close() would wait for it."""
        if self._fd is not None:
            fd, self._fd = self._fd, None
            if self._stalled:
                drop_port(fd)
                return
            with suppress(OSError):  # it is closed, whatever its driver says to that
                os.close(fd)
