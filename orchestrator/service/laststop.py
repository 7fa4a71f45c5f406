"""Stop chargers on bare file descriptors and verify it: for the guardian and `estop`, when nothing else works any more.

Theory of operation. In rounds of half a second, every charger that is not yet known to stand by is sent the stop twice,
then operation 0, then a question; an answer that shows standby is the proof. Twice, because a controller that died in
mid-frame may have left half a frame in a charger's decoder, which then swallows the first stop. A port that fails is
closed, and opened anew by its name in the next round.

Standard library only, few imports, no threads.
"""

import fcntl
import os
import select
import termios
import time
from collections.abc import Callable, Iterable, Mapping

from orchestrator.protocol.standby import ANSWER_BYTES, OPERATION_STOP_FRAME, QUESTION, STOP_FRAME, stands_by

#: What is written when, in seconds from a round's beginning; each frame has left the wire when the next one comes.
STOPS: tuple[tuple[float, bytes], ...] = ((0.0, STOP_FRAME), (0.02, STOP_FRAME), (0.04, OPERATION_STOP_FRAME))
#: Then the charger gets time to obey, and is asked; an answer takes as long as anywhere else (120 ms), and a bit.
ASK_S = 0.25
ANSWER_S = 0.2
ROUND_S = 0.5
#: From an answer's first byte to its last, with an adapter's latency: who reads earlier gets pieces, or leaves some to
#: another process that reads this port.
GATHER_S = 0.01 + ANSWER_BYTES * 10 / 19200
#: Of what came in, kept up to this; far more than one answer.
KEEP = 256
#: 19200 8N1, no flow control, bytes as they are (§2.2.2).
_CONTROL = termios.CS8 | termios.CREAD | termios.CLOCAL
_CHARACTERS: list[bytes | int] = [b"\0"] * 32
_SETTINGS: list[int | list[bytes | int]] = [0, 0, _CONTROL, 0, termios.B19200, termios.B19200, _CHARACTERS]

#: (names of ports, since when) → of those that another process looks after, "" where it has proof, else why not.
Witness = Callable[[Iterable[str], float], Mapping[str, str]]

SILENT = "no proof of standby: the charger does not answer"
RUNS = "NOT stopped: the charger says that it goes on"
STALLED = "the line takes nothing"
GONE = "the line is gone"
HELD = "left alone: a service holds this port"


def stop_all(
    ports: Mapping[str, int | None],
    within_s: float,
    *,
    leave_held: bool = True,
    on_stop: Callable[[], None] = lambda: None,
    on_round: Callable[[], None] = lambda: None,
    witness: Witness = lambda _names, _since_s: {},
) -> dict[str, str]:
    """Stop the charger on every port and wait until each has shown standby; no new round begins after `within_s`.

    `ports` maps names to open descriptors, which are taken over, or to None: opened by name, but not if a service holds
    it and `leave_held` is set. `on_stop` is called after each round's stops, `on_round` after its answers. Ports that
    `witness` knows about are not read here. Returns for each name "" where standby was verified, else why not.
    Never raises for what a port does.
    """
    lines = [_Line(name, fd, leave_held=leave_held) for name, fd in ports.items()]
    doubtful, now_s = lines, time.monotonic()
    end_s, stopped_s = now_s + within_s, None
    while doubtful and now_s < end_s:
        for at_s, frame in STOPS:
            _pause_until(now_s + at_s)
            for line in doubtful:
                line.write(frame)
        on_stop()
        stopped_s = stopped_s or time.monotonic()
        _pause_until(now_s + ASK_S)
        seen = witness([line.name for line in doubtful], stopped_s)
        for line in doubtful:
            line.why = seen.get(line.name, line.why)
        _question([line for line in doubtful if line.name not in seen])
        on_round()
        doubtful = [line for line in doubtful if line.why not in ("", HELD)]
        if doubtful:
            _pause_until(now_s + ROUND_S)
        now_s = time.monotonic()
    for line in lines:
        line.close()
    return {line.name: line.why for line in lines}


def first_stop(name: str, *, leave_held: bool) -> int | None:
    """Open a port and write the first stop before anything else is looked at; the descriptor.

    None where that does not work: `stop_all` tries it again and says why.
    """
    line = _Line(name, None, leave_held=leave_held)
    line.write(STOP_FRAME)
    return line.fd


class _Line:
    """One charger's line and what has become of it; `why` is "" once standby is verified."""

    def __init__(self, name: str, fd: int | None, *, leave_held: bool) -> None:
        self.name, self.fd, self.why = name, fd, SILENT
        self._leave_held = leave_held
        self._heard = b""
        if fd is not None:
            os.set_blocking(fd, False)

    def write(self, frame: bytes) -> None:
        """Write what the line takes now. What a full line still holds is dropped: an old order must not come out."""
        try:
            if self.fd is None:
                self.fd = open_port(self.name, leave_held=self._leave_held)
                self.why = SILENT
            try:
                os.write(self.fd, frame)
            except BlockingIOError:
                _flush(self.fd, termios.TCOFLUSH)
                os.write(self.fd, frame)
        except BlockingIOError:
            self.why = STALLED
        except OSError as error:
            self._failed(error)

    def ask(self) -> None:
        """Put the question; what came in before it proves nothing."""
        self._heard = b""
        if self.fd is not None:
            _flush(self.fd, termios.TCIFLUSH)
            self.write(QUESTION)

    def hear(self) -> None:
        """Take what came in and see what it says."""
        if self.fd is None:
            return
        try:
            data = os.read(self.fd, 4096)
            if not data:
                raise OSError(GONE)
        except BlockingIOError:
            return  # somebody else has read it
        except OSError as error:
            self._failed(error)
            return
        self._heard = (self._heard + data)[-KEEP:]
        standby = stands_by(self._heard)
        if standby is not None:
            self.why = "" if standby else RUNS

    def close(self) -> None:
        """Close the port. What a stalled line has not taken is dropped, since close() would wait for it."""
        if self.fd is not None:
            close = drop_port if self.why == STALLED else os.close
            close(self.fd)
            self.fd = None

    def _failed(self, error: OSError) -> None:
        self.why = error.strerror or str(error)
        self.close()


def open_port(name: str, *, leave_held: bool) -> int:
    """Open a charger's port for stopping: without waiting, and with its settings; the descriptor.

    `leave_held`: only if no service holds it, by the lock that a service puts on it; then it is held. OSError says why.
    """
    try:
        fd = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except ValueError:  # a 0, or half a character: a dying controller may say anything
        raise OSError("not the name of a port") from None
    try:
        if not os.isatty(fd):
            raise OSError("not a serial port")
        if leave_held:
            _lock(fd)
        termios.tcsetattr(fd, termios.TCSANOW, _SETTINGS)
    except termios.error:
        return fd  # its settings may be right all the same
    except OSError:
        os.close(fd)
        raise
    return fd


def _lock(fd: int) -> None:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OSError(HELD) from None


def drop_port(fd: int) -> None:
    """Close a port that is given up. What it has not sent is dropped: close() would wait for a line that is stalled."""
    _flush(fd, termios.TCOFLUSH)
    os.close(fd)


def _flush(fd: int, queue: int) -> None:
    try:
        termios.tcflush(fd, queue)
    except termios.error:
        return  # gone; the next use of it will tell


def _question(lines: list[_Line]) -> None:
    """Ask all of them, and listen until each has shown standby or has had its time."""
    for line in lines:
        line.ask()
    end_s = time.monotonic() + ANSWER_S
    while (left_s := end_s - time.monotonic()) > 0:
        asked = {line.fd: line for line in lines if line.why and line.fd is not None}
        if not asked:
            return
        listener = select.poll()
        for fd in asked:
            listener.register(fd, select.POLLIN)
        if listener.poll(left_s * 1000):
            time.sleep(GATHER_S)
        for fd, _ in listener.poll(0):
            asked[fd].hear()


def _pause_until(at_s: float) -> None:
    left_s = at_s - time.monotonic()
    if left_s > 0:
        time.sleep(left_s)
