"""Stop chargers on bare file descriptors and verify it: for the guardian and `estop`, when nothing else works any more.

Standard library only, few imports, no threads. A controller that died in mid-frame may have left half a frame in a
charger's decoder, which then swallows the first stop; so the first stop is sent twice.
"""

import errno
import os
import select
import time
from collections.abc import Mapping

from orchestrator.protocol.standby import OPERATION_STOP_FRAME, STATUS_REQUEST, STOP_FRAME, stands_by

#: What is written when, in seconds from the beginning of a round; after a round without proof comes another one.
ROUND: tuple[tuple[float, bytes], ...] = (
    (0.0, STOP_FRAME),
    (0.02, STOP_FRAME),
    (0.04, OPERATION_STOP_FRAME),
    (0.25, STATUS_REQUEST),
)
ROUND_S = 0.5
#: A charger's answers are kept up to this; far more than one reply.
KEEP = 256


class _Port:
    """One charger's line and what has become of it; `verdict` is "" once standby is verified."""

    def __init__(self, name: str, fd: int) -> None:
        self.name, self.fd = name, fd
        self.heard = b""
        self.verdict: str | None = None

    def write(self, frame: bytes) -> None:
        """Write what the line takes now; a line that takes nothing is tried again by the next round."""
        try:
            os.write(self.fd, frame)
        except OSError as error:
            if error.errno not in (errno.EAGAIN, errno.EINTR):
                self.verdict = f"{self.name}: {error.strerror}"

    def read(self) -> None:
        """Take what came in and see whether it proves standby."""
        try:
            data = os.read(self.fd, KEEP)
        except OSError as error:
            if error.errno not in (errno.EAGAIN, errno.EINTR):
                self.verdict = f"{self.name}: {error.strerror}"
            return
        if not data:
            self.verdict = f"{self.name}: the line is gone"
            return
        self.heard = (self.heard + data)[-KEEP:]
        if stands_by(self.heard):
            self.verdict = ""


def stop_all(ports: Mapping[str, int], within_s: float) -> dict[str, str]:
    """Stop the charger on every port and wait until each has shown standby, at most `within_s` seconds.

    `ports` maps names to open descriptors (raw mode, 19200 8N1). Returns for each name "" where standby was verified,
    else why not. Never raises for what a port does.
    """
    live = [_Port(name, fd) for name, fd in ports.items()]
    for port in live:
        os.set_blocking(port.fd, False)
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s and any(port.verdict is None for port in live):
        _round(live)
    silent = "no proof of standby: the charger does not answer, or goes on"
    return {port.name: silent if port.verdict is None else port.verdict for port in live}


def _round(ports: list[_Port]) -> None:
    """One stop, its repetition, operation 0, a question, and the answers to it."""
    began_s = time.monotonic()
    for at_s, frame in ROUND:
        _listen(ports, began_s + at_s)
        for port in ports:
            if port.verdict is None:
                if frame is STATUS_REQUEST:
                    port.heard = b""  # an older answer proves nothing
                port.write(frame)
    _listen(ports, began_s + ROUND_S)


def _listen(ports: list[_Port], until_s: float) -> None:
    """Read what comes in until then, or until nobody is left to be heard."""
    while True:
        waiting = {port.fd: port for port in ports if port.verdict is None}
        left_s = until_s - time.monotonic()
        if not waiting or left_s <= 0:
            return
        for fd in select.select(list(waiting), [], [], left_s)[0]:
            waiting[fd].read()
