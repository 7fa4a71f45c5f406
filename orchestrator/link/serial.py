"""The serial port to a charger: the only user of pyserial. Every failure here becomes a LinkError.

pyserial does what it is good at: opening, locking and setting up the port. The rest avoids its traps: we wait with
poll(), because pyserial's write spins on a full line and its timeouts reconfigure the port.

The port is not ours alone. Any process that has it open may change its settings (`line_settings.py`), or may have
locked it before us: another orchestrator's lock is respected; any other lock must not block a stop.
"""

import errno
import fcntl
import os
import select
import termios
import time
from contextlib import suppress
from typing import Self

import serial
from serial.rs485 import RS485Settings

from orchestrator.errors import LinkError
from orchestrator.lastresort import line_settings
from orchestrator.lastresort.port_owner import holder
from orchestrator.link.port_cause import GONE, errno_of, port_cause, program, settings_found
from orchestrator.model import Cause

BAUD = 19200  #: 8 data bits, no parity, 1 stop bit, no flow control (protocol 2/2, §2.2.2)
BYTE_S = 10 / BAUD  #: start bit, 8 data bits, stop bit: 0.52 ms
WRITE_TIMEOUT_S = 0.2  #: one slot; an idle line takes a frame at once, since the kernel buffers it

_READ_SIZE = 4096  #: more than a line can deliver in several slots
#: The exceptions of pyserial 3.5 for a port that is unplugged, closed, odd or missing (SerialException is an OSError).
_FAILURES = (OSError, termios.error, TypeError, ValueError)

_ESSENTIAL = ("baud", "data bits", "parity")  #: without these no charger understands anything


class SerialLine:
    """One open serial port, used by one thread. Every method except `close` raises LinkError once the port fails."""

    def __init__(self, port: serial.Serial, *, locked: bool = True) -> None:
        self._port, self._path = port, str(port.port)
        self._fd: int = port.fileno()
        self._locked = locked
        self._readable = select.poll()
        self._readable.register(self._fd, select.POLLIN)
        self._writable = select.poll()
        self._writable.register(self._fd, select.POLLOUT)
        self._tolerated = ""
        self._restore()  # pyserial does not set all of it; output may be suspended, say
        self._tolerated = self._restore()  # what the driver does not take is nobody else's doing
        if any(word in self._tolerated for word in _ESSENTIAL):
            found = tuple(self._tolerated.split(", "))
            raise LinkError(Cause.of("port_stubborn", port=self._path, baud=BAUD, found=found))

    @classmethod
    def open(cls, path: str, *, kernel_rs485: bool = False) -> Self:
        """Open `path` exclusively, and discard earlier input.

        A port locked by a foreign program is opened anyway: `locked_by` says so. `kernel_rs485`: let the serial driver
        switch the line's direction (RTS high while sending). Adapters that switch automatically do not need it.
        LinkError says what is wrong and what to do.
        """
        locked = True
        try:
            port = _open(path, exclusive=True)
        except LinkError as error:
            if error.__cause__ is None or errno_of(error.__cause__) != errno.EAGAIN or holder(path).ours:
                raise
            locked, port = False, _open(path, exclusive=None)
        if kernel_rs485:
            try:
                port.rs485_mode = RS485Settings()
            except _FAILURES as error:
                port.close()
                raise LinkError(Cause.of("port_not_rs485", port=path)) from error
        try:
            return cls(port, locked=locked)
        except LinkError:
            port.close()
            raise

    def restore(self) -> Cause | None:
        """Set the port up again if another program has changed it; what was found, None where all was well."""
        return settings_found(self._restore())

    def _restore(self) -> str:
        try:
            return line_settings.restore(self._port.fileno(), self._tolerated)
        except _FAILURES as error:
            raise self._failed(error) from error

    def locked_by(self) -> Cause | None:
        """Which program holds the port's lock instead of us, None once it is ours: it is asked for again each time."""
        try:
            fd = self._port.fileno()
            line_settings.share(fd)
            if not self._locked:
                fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._locked = True
        except BlockingIOError:
            return program(holder(self._path, (os.getpid(), os.getppid())))
        except _FAILURES as error:
            raise self._failed(error) from error
        return None

    def write(self, data: bytes) -> None:
        """Hand `data` to the port; it is on the wire `BYTE_S` a byte later. LinkError if the line takes nothing."""
        try:
            # Not by pyserial: on a full line its write spins until the time-out, and it always costs twice as much.
            room = self._writable.poll(WRITE_TIMEOUT_S * 1000)
            if not room or os.write(self._port.fileno(), data) < len(data):
                raise serial.SerialTimeoutException
        except (serial.SerialTimeoutException, BlockingIOError) as error:
            self._forget_output()
            raise LinkError(Cause.of("port_stalled", port=self._path, limit_s=WRITE_TIMEOUT_S)) from error
        except _FAILURES as error:
            raise self._failed(error) from error

    def read(self, timeout_s: float, expected: int = 0) -> bytes:
        """Whatever has arrived, after `timeout_s` at the latest; b"" if nothing has.

        `expected`: the number of bytes still to cross the wire, ours and theirs. Sleeping for that time, instead of
        waking for every few bytes, takes a third of the CPU time.
        """
        pause_s = min(timeout_s, expected * BYTE_S)
        if pause_s > 0:
            time.sleep(pause_s)
        try:
            if not self._readable.poll(max(0.0, timeout_s - pause_s) * 1000):
                return b""
            data = os.read(self._port.fileno(), _READ_SIZE)
            if not data:
                raise serial.SerialException("the end of the line was read: it is gone, or has a second reader")
        except _FAILURES as error:
            raise self._failed(error) from error
        return data

    def fileno(self) -> int:
        """The open file, for sharing with another process. LinkError once closed."""
        try:
            return self._port.fileno()
        except _FAILURES as error:
            raise self._failed(error) from error

    def close(self) -> None:
        """Release the port; written bytes are still sent. May be called repeatedly, and after any failure."""
        try:
            self._port.close()
        except _FAILURES:
            # The port is already gone.
            self._port.is_open = False

    def _forget_output(self) -> None:
        """Drop a stalled line's unsent output: an old command must not go out minutes later."""
        try:
            self._port.reset_output_buffer()
        except _FAILURES:
            return  # the port is gone, so nothing can be sent

    def _failed(self, error: Exception) -> LinkError:
        return LinkError(port_cause(error, self._path, otherwise=GONE))


def _open(path: str, *, exclusive: bool | None) -> serial.Serial:
    """`exclusive`: with a flock, taken before anything else: it excludes a second service, but not a stop tool.

    TIOCEXCL would exclude stop tools too, so it is not set. None: without a lock.
    """
    port = serial.Serial(None, baudrate=BAUD, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=exclusive)
    port.port = path
    try:
        try:
            port.open()
        except _FAILURES:
            if not _taken_back(path):
                raise
            port.open()
    except _FAILURES as error:
        raise LinkError(port_cause(error, path, otherwise="port_failed")) from error
    return port


def _taken_back(path: str) -> bool:
    """Whether the port had another line discipline, now corrected: with N_NULL, pyserial cannot open it."""
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except (OSError, ValueError):
        return False
    try:
        return bool(line_settings.take_back(fd))
    except OSError:
        return False
    finally:
        with suppress(OSError):
            os.close(fd)
