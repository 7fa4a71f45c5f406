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

BAUD = 19200  #: 8 data bits, no parity, 1 stop bit, no flow control (protocol 2/2, §2.2.2)
BYTE_S = 10 / BAUD  #: start bit, 8 data bits, stop bit: 0.52 ms
WRITE_TIMEOUT_S = 0.2  #: one slot; an idle line takes a frame at once, since the kernel buffers it

_READ_SIZE = 4096  #: more than a line can deliver in several slots
#: The exceptions of pyserial 3.5 for a port that is unplugged, closed, odd or missing (SerialException is an OSError).
_FAILURES = (OSError, termios.error, TypeError, ValueError)

_MISSING = "no such port: check that the adapter is plugged in, and the name (ls -l /dev/serial/by-path)"
_GONE = "the adapter was unplugged or lost its power, or another program reads this port; plug it in again"
_BUSY = "in use: another program holds it, or two bays name the same port; close the other one (lsof shows it)"
_FORBIDDEN = "permission denied: add the user that runs this to the group dialout, then log in again"
_NO_PORT = "it is no serial port: check the name in the station file (ls -l /dev/serial/by-path)"
_STUBBORN = f"its driver does not take the charger's settings, {BAUD} baud 8N1; use another adapter"
_ESSENTIAL = ("baud", "data bits", "parity")  #: without these no charger understands anything
_STALLED = f"stalled, it took nothing for {WRITE_TIMEOUT_S:g} s; unplug the adapter and plug it in again"
_TAKEN = (
    "another program has opened it for itself alone (TIOCEXCL), so that nobody else can stop this charger: end that "
    "program{who}, or cut the charger's mains"
)
_FULL = "too many open files: raise the limit of the service (LimitNOFILE)"

#: What is wrong and what to do, by errno.
_SENTENCES = {
    errno.ENOENT: _MISSING,
    errno.EACCES: _FORBIDDEN,
    errno.EPERM: _FORBIDDEN,
    errno.EAGAIN: _BUSY,  # its lock (flock) is taken
    errno.EBUSY: _TAKEN,
    errno.EIO: _GONE,
    errno.ENXIO: _GONE,
    errno.ENODEV: _GONE,
    errno.ENOTTY: _NO_PORT,
    errno.EINVAL: _NO_PORT,
    errno.EISDIR: _NO_PORT,
    errno.EMFILE: _FULL,
    errno.ENFILE: _FULL,
}


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
        self.restore()  # pyserial does not set everything; output may be suspended, for example
        self._tolerated = self.restore()  # any remaining difference is due to the driver
        if any(word in self._tolerated for word in _ESSENTIAL):
            raise LinkError(f"{self._path}: {_STUBBORN} ({self._tolerated})")

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
            if error.__cause__ is None or _number(error.__cause__) != errno.EAGAIN or holder(path).ours:
                raise
            locked, port = False, _open(path, exclusive=None)
        if kernel_rs485:
            try:
                port.rs485_mode = RS485Settings()
            except _FAILURES as error:
                port.close()
                raise LinkError(
                    f"{path}: its driver cannot switch the direction of an RS-485 line (rs485: kernel); "
                    "use an adapter that switches by itself, with rs485: off"
                ) from error
        try:
            return cls(port, locked=locked)
        except LinkError:
            port.close()
            raise

    def restore(self) -> str:
        """Set the port up again if another program has changed it; returns what was found, "" if all was well."""
        try:
            return line_settings.restore(self._port.fileno(), self._tolerated)
        except _FAILURES as error:
            raise self._failed(error) from error

    def locked_by(self) -> str:
        """The program that holds the port's lock instead of us, "" once it is ours: each call tries again to get it."""
        try:
            fd = self._port.fileno()
            line_settings.share(fd)
            if not self._locked:
                fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._locked = True
        except BlockingIOError:
            return str(holder(self._path, (os.getpid(), os.getppid())))
        except _FAILURES as error:
            raise self._failed(error) from error
        return ""

    def write(self, data: bytes) -> None:
        """Hand `data` to the port; it is on the wire `BYTE_S` a byte later. LinkError if the line takes nothing."""
        try:
            # Not by pyserial: on a full line its write spins until the time-out, and it always costs twice as much.
            room = self._writable.poll(WRITE_TIMEOUT_S * 1000)
            if not room or os.write(self._port.fileno(), data) < len(data):
                raise serial.SerialTimeoutException
        except (serial.SerialTimeoutException, BlockingIOError) as error:
            self._forget_output()
            raise LinkError(f"{self._path}: {_STALLED}") from error
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
        return LinkError(f"{self._path}: {_sentence(error, self._path, otherwise=_GONE)}")


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
        raise LinkError(f"{path}: {_sentence(error, path, otherwise='cannot be opened')}") from error
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


def _sentence(error: BaseException, path: str, *, otherwise: str) -> str:
    """The sentence for an error, by its errno."""
    number = _number(error)
    if number is None:
        return f"{otherwise} ({error})"
    sentence = _SENTENCES.get(number) or f"{otherwise} ({os.strerror(number)})"
    return sentence.format(who=_who(path)) if "{who}" in sentence else sentence


def _who(path: str) -> str:
    """ " gpsd (pid 812)", "" if unknown."""
    found = holder(path, (os.getpid(),))
    return f" {found}" if found.pid else ""


def _number(error: BaseException) -> int | None:
    """An error's errno: pyserial often keeps it only in the error's cause or first argument."""
    cause: BaseException | None = error
    while cause is not None:
        number = getattr(cause, "errno", None) or (cause.args[0] if cause.args else None)
        if isinstance(number, int):
            return number
        cause = cause.__context__
    return None
