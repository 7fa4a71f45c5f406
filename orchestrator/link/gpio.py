"""A GPIO line that drives a contactor: the only user of gpiod. Every failure here becomes a LinkError.

gpiod is an extra, imported only if a station names a contactor. The kernel gives a line to one owner at a time, and an
owner is an open file: it can be shared with another process (where `lastresort/lastopen.py` drives it without a
library).
"""

import errno
import os
from typing import TYPE_CHECKING, Self

from orchestrator.errors import LinkError

if TYPE_CHECKING:
    import gpiod
    from gpiod.line import Value

#: What `gpioinfo` shows as the line's user.
CONSUMER = "orchestrator"

_NO_CHIP = "no such GPIO chip: check the name in the station file (gpiodetect lists them)"
_FORBIDDEN = "permission denied: add the user that runs this to the chip's group (ls -l shows it), then log in again"
_BUSY = "in use: another program or a driver of the kernel holds the line (gpioinfo shows which)"
_NO_LINE = "it has no such line, or the line cannot be an output (gpioinfo lists them)"
_GONE = "not a GPIO chip, or one that is gone: check its name (gpiodetect lists them), or plug its adapter in again"

#: What is wrong and what to do, by errno.
_SENTENCES = {
    errno.ENOENT: _NO_CHIP,
    errno.ENOTTY: _NO_CHIP,
    errno.EACCES: _FORBIDDEN,
    errno.EPERM: _FORBIDDEN,
    errno.EBUSY: _BUSY,
    errno.EINVAL: _NO_LINE,
    errno.EIO: _GONE,
    errno.ENODEV: _GONE,
    errno.ENXIO: _GONE,
}


def need_gpiod() -> None:
    """LinkError if the library is not installed."""
    try:
        import gpiod  # noqa: F401, PLC0415 - only where a station has a contactor
    except ImportError:
        raise LinkError(
            "the station file names a contactor, which needs the package gpiod: "
            "pip install 'charging-station-orchestrator[gpio]'"
        ) from None


class OutputLine:
    """One GPIO line as an output, ours until closed. Every method except `close` raises LinkError once it fails."""

    def __init__(self, request: "gpiod.LineRequest", chip: str, line: int, values: "tuple[Value, Value]") -> None:
        self._request, self._chip, self._line = request, chip, line
        self._values = values  # open, closed

    @classmethod
    def open(cls, chip: str, line: int, *, active_low: bool) -> Self:
        """Take the line and drive it inactive: the contactor opens, or stays open."""
        need_gpiod()
        import gpiod  # noqa: PLC0415 - as above
        from gpiod.line import Direction, Value  # noqa: PLC0415 - as above

        values = (Value.INACTIVE, Value.ACTIVE)
        settings = gpiod.LineSettings(direction=Direction.OUTPUT, active_low=active_low, output_value=values[0])
        try:
            request = gpiod.request_lines(chip, {line: settings}, consumer=CONSUMER)
        except (OSError, ValueError) as error:
            raise _failed(error, chip, line) from error
        return cls(request, chip, line, values)

    def drive(self, *, closed: bool) -> None:
        """Close the contactor, or open it."""
        try:
            self._request.set_value(self._line, self._values[closed])
        except OSError as error:
            raise _failed(error, self._chip, self._line) from error

    def fileno(self) -> int:
        """The open file, for sharing with another process."""
        return self._request.fd

    def close(self) -> None:
        """Release the line in its present state. May be called repeatedly."""
        self._request.release()


def describe(chip: str, line: int) -> str:
    """The kernel's description of a line, without taking it: its name, its direction, and its user."""
    need_gpiod()
    import gpiod  # noqa: PLC0415 - as above

    try:
        with gpiod.Chip(chip) as opened:
            info = opened.get_line_info(line)
    except (OSError, ValueError) as error:
        raise _failed(error, chip, line) from error
    user = f"used by {info.consumer or 'the kernel'}" if info.used else "free"
    name = f" ({info.name})" if info.name else ""
    return f"{chip} line {line}{name}: {info.direction.name.lower()}, {user}"


def _failed(error: Exception, chip: str, line: int) -> LinkError:
    number = error.errno if isinstance(error, OSError) else errno.EINVAL  # gpiod: "line offset out of range"
    sentence = _SENTENCES.get(number or 0) or f"cannot be driven ({os.strerror(number or 0)})"
    return LinkError(f"{chip} line {line}: {sentence}")
