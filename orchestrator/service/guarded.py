"""The controller's side of the guardian: heartbeats, shared descriptors, and detecting that it is gone."""

import array
import socket
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from orchestrator.lastresort.guardian import ALIVE, BEAT, CONTACTOR, DONE, DROP, PORT
from orchestrator.link.serial import SerialLine
from orchestrator.model import Cause

if TYPE_CHECKING:
    from orchestrator.link.gpio import OutputLine

#: A guardian that has not answered a heartbeat for this long is gone, or hangs.
SILENCE_S = 2.0
DIED = Cause("guardian_died")


class GuardianLink:
    """Talks to the guardian over an inherited socket. `beat` belongs to the control loop, the rest to any thread."""

    def __init__(self, fd: int) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.set_inheritable(False)  # our end must close when we die
        self._socket.settimeout(0)
        self._lock = threading.Lock()
        self._heard_s: float | None = None
        self._gone: Cause | None = None
        self.holds = False  #: it has been given a port

    def beat(self, now_s: float, *, well: bool) -> Cause | None:
        """Say that every loop has turned, if that is so. Why the guardian cannot be relied on any more."""
        self._heard_s = now_s if self._heard_s is None or self._answered() else self._heard_s
        if well:
            self._send(BEAT)
        if not self._gone and now_s - self._heard_s > SILENCE_S:
            self._gone = Cause.of("guardian_silent", limit_s=SILENCE_S)
        return self._gone

    def hold(self, port: str, fd: int) -> None:
        """Give the guardian a duplicate descriptor of an open port."""
        self.holds = True
        self._send(PORT + port.encode(errors="surrogateescape"), fd)

    def drop(self, port: str) -> None:
        """Let the guardian close its descriptor, so that the port's name becomes free."""
        self._send(DROP + port.encode(errors="surrogateescape"))

    def hold_contactor(self, name: str, fd: int | None) -> None:
        """Give the guardian a duplicate descriptor of a contactor's line; None: let it close the one it has."""
        self._send(CONTACTOR + name.encode(errors="surrogateescape"), fd)

    def done(self) -> None:
        """Report that every charger was stopped, and verified if possible: no further stop is needed."""
        self._send(DONE)

    def _answered(self) -> bool:
        heard = False
        while True:
            try:
                data = self._socket.recv(16)
            except BlockingIOError:
                return heard
            except OSError:
                data = b""  # it died with our messages unread
            if not data:
                self._gone = DIED
                return heard
            heard = heard or data == ALIVE

    def _send(self, message: bytes, fd: int | None = None) -> None:
        """Send without blocking. A guardian that takes no message is unreliable: it must not miss a port."""
        ancillary = [] if fd is None else [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [fd]))]
        try:
            with self._lock:
                self._socket.sendmsg([message], ancillary)
        except BlockingIOError:
            self._gone = self._gone or Cause("guardian_full")
        except OSError:
            self._gone = self._gone or DIED


class GuardedLine:
    """A serial line; the guardian has a duplicate of it while it is open."""

    def __init__(self, port: str, open_line: Callable[[], SerialLine], guardian: GuardianLink) -> None:
        self._port, self._guardian = port, guardian
        self._line = open_line()
        guardian.hold(port, self._line.fileno())
        self.write, self.read = self._line.write, self._line.read
        self.restore, self.locked_by = self._line.restore, self._line.locked_by

    def close(self) -> None:
        """Release the port, also in the guardian."""
        self._guardian.drop(self._port)
        self._line.close()


class GuardedOutput:
    """A contactor's line; the guardian has a duplicate of it while it is open."""

    def __init__(self, name: str, open_output: "Callable[[], OutputLine]", guardian: GuardianLink) -> None:
        self._name, self._guardian = name, guardian
        self._output = open_output()
        guardian.hold_contactor(name, self._output.fileno())
        self.drive = self._output.drive

    def close(self) -> None:
        """Release the line, also in the guardian."""
        self._guardian.hold_contactor(self._name, None)
        self._output.close()
