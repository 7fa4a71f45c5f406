"""The settings that a charger's port needs, and how to restore them after another program has changed them.

A tty has one set of settings for all processes that have it open: after `stty -F PORT 115200` (or a getty, a modem
manager, a terminal program) every stop goes out at that speed, and the charger does not understand it. So they are
checked before each stop; that takes a few microseconds, and only differences are set. Standard library only: the
guardian and `estop` use it as well.
"""

import errno
import fcntl
import sys
import termios
from collections.abc import Sequence

#: 19200 8N1, no flow control, raw bytes (protocol 2/2, §2.2.2); a read returns whatever is available.
_INPUT = (
    termios.IGNBRK | termios.BRKINT | termios.PARMRK | termios.INPCK | termios.ISTRIP
    | termios.INLCR | termios.IGNCR | termios.ICRNL
)  # fmt: skip
_SOFTWARE = termios.IXON | termios.IXOFF | termios.IXANY
_FORMAT = termios.CSIZE | termios.CSTOPB | termios.PARENB | termios.CREAD | termios.CLOCAL | termios.CRTSCTS
_LOCAL = termios.ICANON | termios.ISIG | termios.IEXTEN | termios.ECHO | termios.ECHONL
#: The bits that we control, by tcgetattr's index: (mask, required value).
_OURS: tuple[tuple[int, int], ...] = (
    (_INPUT | _SOFTWARE, 0),
    (termios.OPOST, 0),
    (_FORMAT, termios.CS8 | termios.CREAD | termios.CLOCAL),
    (_LOCAL, 0),
)
_SPEED = termios.B19200
#: (index, bits, value, description); None: any value but the required one.
_WORDS: tuple[tuple[int, int, int | None, str], ...] = (
    (2, termios.CSIZE, termios.CS5, "5 data bits"),
    (2, termios.CSIZE, termios.CS6, "6 data bits"),
    (2, termios.CSIZE, termios.CS7, "7 data bits"),
    (2, termios.CSTOPB, None, "2 stop bits"),
    (2, termios.PARENB | termios.PARODD, termios.PARENB, "even parity"),
    (2, termios.PARENB | termios.PARODD, termios.PARENB | termios.PARODD, "odd parity"),
    (2, termios.CRTSCTS, None, "hardware flow control"),
    (0, _SOFTWARE, None, "software flow control"),
    (2, termios.CREAD, None, "receiver off"),
    (2, termios.CLOCAL, None, "modem control"),
    (3, termios.ECHO | termios.ECHONL, None, "echo on"),
    (3, termios.ICANON, None, "reading line by line"),
    (3, termios.ISIG | termios.IEXTEN, None, "control characters"),
    (0, _INPUT, None, "translated input"),
    (1, termios.OPOST, None, "translated output"),
)
_BAUDS = {
    getattr(termios, name): name[1:] for name in dir(termios) if name.startswith("B") and name[1:].isdecimal()
}  # fmt: skip
_N_TTY = 0  #: the line discipline for raw bytes; others turn them into packets (`ldattach`, `slattach`, `pppd`)
_TIOCGEXCL = 0x80045440  #: asm-generic/ioctls.h
_UNKNOWN = (errno.ENOTTY, errno.EINVAL)


def restore(fd: int, tolerated: str = "") -> str:
    """Set the port up again if somebody has changed it; returns what was found, "" if all was well.

    `tolerated`: the differences due to the driver's limitations. Suspended output resumes. Raises OSError or
    termios.error for a port that is gone.
    """
    found = [words] if (words := take_back(fd)) else []
    *flags, characters = termios.tcgetattr(fd)
    words = differences(flags, characters)
    if words and words != tolerated:
        set_up(fd)
        found.append(words)
    # There is no way to query whether output is suspended (TCOOFF, or a received XOFF); resuming is harmless.
    termios.tcflow(fd, termios.TCOON)
    return ", ".join(found)


def take_back(fd: int) -> str:
    """Set the raw line discipline; returns which other one was found, "" if all was well.

    With some others (N_NULL) a tty does not even identify itself as one, and accepts no bytes: so this comes before
    anything else. A file that is not a tty has none, and stays unchanged. OSError for a port that is gone.
    """
    discipline = _number(fd, termios.TIOCGETD)
    if discipline == _N_TTY:
        return ""
    fcntl.ioctl(fd, termios.TIOCSETD, _N_TTY.to_bytes(4, sys.byteorder))
    return f"line discipline {discipline}"


def set_up(fd: int) -> None:
    """Set the line to 19200 8N1; other bits stay. OSError or termios.error for a port that is gone."""
    attributes = termios.tcgetattr(fd)
    for at, (bits, value) in enumerate(_OURS):
        attributes[at] = attributes[at] & ~bits | value
    attributes[4] = attributes[5] = _SPEED
    attributes[6][termios.VMIN] = attributes[6][termios.VTIME] = 0
    termios.tcsetattr(fd, termios.TCSANOW, attributes)


def share(fd: int) -> str:
    """Let others, stop tools above all, open the port again if somebody has forbidden it; returns what was found."""
    if not _number(fd, _TIOCGEXCL):
        return ""
    fcntl.ioctl(fd, termios.TIOCNXCL)
    return "one program's alone (TIOCEXCL)"


def differences(flags: Sequence[int], characters: Sequence[bytes | int]) -> str:
    """The settings that do not suit a charger, for people: "115200 baud, echo on"; "" if all is well.

    `flags` and `characters` are the first six items and the last item from termios.tcgetattr.
    """
    speeds = sorted({flags[4], flags[5]} - {_SPEED})
    found = [f"{_BAUDS.get(speed, 'an odd number of')} baud" for speed in speeds]
    for at, bits, value, words in _WORDS:
        has, must = flags[at] & bits, _OURS[at][1] & bits
        if (has != must) if value is None else (has == value):
            found.append(words)
    # In line-editing mode these are characters with another meaning; that mode is reported above.
    if any(isinstance(count, int) and count for count in (characters[termios.VMIN], characters[termios.VTIME])):
        found.append("reads that wait for more")
    return ", ".join(found)


def _number(fd: int, question: int) -> int:
    """The kernel's answer to an ioctl that returns an int; 0 if the driver does not know it."""
    answer = bytearray(4)
    try:
        fcntl.ioctl(fd, question, answer)
    except OSError as error:
        if error.errno not in _UNKNOWN:
            raise
    return int.from_bytes(answer, sys.byteorder)
