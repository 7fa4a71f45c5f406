"""Opens contactors on bare file descriptors: for the guardian and `estop`, when nothing else works any more.

Theory of operation. A GPIO line requested from the kernel is an open file; any process that has it can drive the line
with one ioctl, whatever library requested it. The guardian has duplicates of the controller's lines; `estop`, which
runs when nobody else may be left, requests the lines again. Values are logical: the kernel knows which lines are active
low.

First the stop, then the contactor. A contactor that breaks a load wears out, and may weld when it is next needed; a
charger that obeys delivers no current after the first round of stops (`lastline.ROUND_S`, half a second). So contactors
open after that round: without load if the stop was obeyed, under load if nothing else is left. Waiting longer would
only prolong an uncontrolled charge.

The numbers are from linux/gpio.h (GPIO ABI v2, Linux 5.10), with ioctls numbered as in asm-generic/ioctl.h: on x86, ARM
and RISC-V. Standard library only.
"""

import errno
import fcntl
import os
import struct

#: _IOWR(0xB4, 0x07, struct gpio_v2_line_request) and _IOWR(0xB4, 0x0F, struct gpio_v2_line_values).
GET_LINE = 0xC250B407
SET_VALUES = 0xC010B40F
#: struct gpio_v2_line_values: bits, mask. The request's only line is its line 0.
OPEN = struct.pack("=QQ", 0, 1)
#: struct gpio_v2_line_request, up to the returned descriptor: offsets[64] (the first is ours), consumer[32],
#: config {flags, num_attrs, padding[5], attrs[10]}, num_lines, event_buffer_size, padding[5]; fd.
REQUEST = struct.Struct("=I252x32sQI20x240xII20xi")
#: enum gpio_v2_line_flag
ACTIVE_LOW, OUTPUT = 1 << 1, 1 << 3
CONSUMER = b"orchestrator estop"

HELD = "left to who holds it"
OPENED = "open"


def open_contactor(fd: int) -> str:
    """Open the contactor on a requested line; returns OPENED, or why not."""
    try:
        fcntl.ioctl(fd, SET_VALUES, OPEN)
    except OSError as error:
        return error.strerror or str(error)
    return OPENED


def request(chip: str, line: int, *, active_low: bool) -> str:
    """Open a contactor whose line nobody holds; returns the result. A line that is held is left alone.

    The line is released at once: from then on the driver controls it again, as in a gateway without power.
    """
    flags = OUTPUT | (ACTIVE_LOW if active_low else 0)
    # An output without a value is requested inactive.
    asked = bytearray(REQUEST.pack(line, CONSUMER, flags, 0, 1, 0, 0))
    try:
        fd = os.open(chip, os.O_RDWR | os.O_CLOEXEC)
        try:
            fcntl.ioctl(fd, GET_LINE, asked)
        finally:
            os.close(fd)
    except OSError as error:
        return HELD if error.errno == errno.EBUSY else error.strerror or str(error)
    os.close(REQUEST.unpack(asked)[-1])
    return OPENED
