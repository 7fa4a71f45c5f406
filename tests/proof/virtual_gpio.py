"""GPIO chips in virtual time, ioctl by ioctl, and the contactors on their lines.

The substitute for gpiod's request uses the same kernel, so a line is an open file here too: it is held, it is shared
with the guardian, and it keeps its level when nobody holds it any more, as a real chip's line may.
"""

import errno
import os
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

from orchestrator.lastresort.lastopen import ACTIVE_LOW, GET_LINE, OUTPUT, REQUEST, SET_VALUES
from orchestrator.link import gpio
from tests.proof.virtual_time import Time

if TYPE_CHECKING:
    from tests.proof.virtual_descriptors import Descriptors
    from tests.proof.virtual_kernel import Kernel

VALUES = struct.Struct("=QQ")


@dataclass(slots=True, eq=False)
class Output:
    """One line of a chip."""

    drive: Callable[[bool], None]  #: to closed, or to open
    held: bool = False


@dataclass(slots=True, eq=False)
class Chip:
    """A chip, possibly on an unplugged adapter."""

    outputs: dict[int, Output] = field(default_factory=dict)
    present: bool = True


class Breaker:
    """A contactor: it follows its line at once, later, or not at all."""

    def __init__(self, time: Time) -> None:
        self.closed = False  #: an undriven line with its pull-down
        self.slow_s = 0.0
        self.stuck = False  #: welded, or jammed
        self.on_moved: Callable[[bool], None] = lambda _closed: None
        self._time, self._driven = time, False

    def drive(self, closed: bool) -> None:
        self._driven = closed
        if self.slow_s:
            self._time.call_later(self.slow_s, self._follow)
        else:
            self._follow()

    def _follow(self) -> None:
        if not self.stuck and self.closed is not self._driven:
            self.on_moved(self._driven)
            self.closed = self._driven


def request_line(kernel: "Descriptors", chip: Chip, name: str, argument: bytearray) -> int:
    """GPIO_V2_GET_LINE_IOCTL."""
    offset, consumer, flags, *rest = REQUEST.unpack(argument)
    output = chip.outputs.get(offset)
    if output is None or not flags & OUTPUT:
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
    if output.held:
        raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
    output.held = True
    output.drive(False)
    fd = kernel.new_line(f"{name}:{offset}", output)
    argument[:] = REQUEST.pack(offset, consumer, flags, *rest[:-1], fd)
    return 0


class VirtualLine:
    """The counterpart of `link.gpio.OutputLine` on the virtual kernel."""

    def __init__(self, kernel: "Kernel", fd: int, chip: str, line: int) -> None:
        self._kernel, self._fd, self._chip, self._line = kernel, fd, chip, line

    @classmethod
    def open(cls, kernel: "Kernel", chip: str, line: int, *, active_low: bool) -> Self:
        flags = OUTPUT | (ACTIVE_LOW if active_low else 0)
        asked = bytearray(REQUEST.pack(line, b"orchestrator", flags, 0, 1, 0, 0))
        try:
            fd = kernel.open(chip, os.O_RDWR)
            try:
                kernel.ioctl(fd, GET_LINE, asked)
            finally:
                kernel.close(fd)
        except OSError as error:
            raise gpio._failed(error, chip, line) from error
        return cls(kernel, REQUEST.unpack(asked)[-1], chip, line)

    def drive(self, *, closed: bool) -> None:
        try:
            self._kernel.ioctl(self._fd, SET_VALUES, VALUES.pack(closed, 1))
        except OSError as error:
            raise gpio._failed(error, self._chip, self._line) from error

    def fileno(self) -> int:
        return self._fd

    def close(self) -> None:
        self._kernel.close(self._fd)


def set_values(output: Output, argument: Any) -> int:
    """GPIO_V2_LINE_SET_VALUES_IOCTL: one line, logical values."""
    bits, mask = VALUES.unpack(bytes(argument))
    if mask & 1:
        output.drive(bool(bits & 1))
    return 0
