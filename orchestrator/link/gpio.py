"""A GPIO line that drives a contactor: the only user of gpiod. Every failure here becomes a LinkError.

gpiod is an extra, imported only if a station names a contactor. The kernel gives a line to one owner at a time, and an
owner is an open file: it can be shared with another process (where `lastresort/lastopen.py` drives it without a
library).
"""

import errno
from typing import TYPE_CHECKING, Self

from orchestrator.errors import LinkError
from orchestrator.extras import install_extra
from orchestrator.model import Cause

if TYPE_CHECKING:
    import gpiod
    from gpiod.line import Value

#: What `gpioinfo` shows as the line's user.
CONSUMER = "orchestrator"

#: The cause, by what the kernel says; each says what to do.
_CAUSES = {
    errno.ENOENT: "gpio_missing",
    errno.ENOTTY: "gpio_missing",
    errno.EACCES: "gpio_forbidden",
    errno.EPERM: "gpio_forbidden",
    errno.EBUSY: "gpio_busy",
    errno.EINVAL: "gpio_no_line",
    errno.EIO: "gpio_gone",
    errno.ENODEV: "gpio_gone",
    errno.ENXIO: "gpio_gone",
}


def need_gpiod() -> None:
    """LinkError if the library is not installed."""
    try:
        import gpiod  # noqa: F401, PLC0415 - only where a station has a contactor
    except ImportError:
        raise LinkError(Cause.of("gpio_not_installed", install=install_extra("gpio"))) from None


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
    id_ = _CAUSES.get(number or 0, "gpio_failed")
    return LinkError(Cause.of(id_, chip=chip, line=line, error=errno.errorcode.get(number or 0, str(number))))
