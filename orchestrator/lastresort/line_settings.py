"""What a charger's port must be set to, and what to do when somebody else has set it to something else.

A tty has one group of settings for everybody who has it open: after `stty -F PORT 115200` (or a getty, a modem manager,
a terminal program) every stop goes out at that speed, and nobody hears it. So they are looked at before each stop;
that costs some microseconds, and only what differs is set. Standard library only: the guardian and `estop` use it, too.
"""

import errno
import fcntl
import sys
import termios
from collections.abc import Sequence

#: 19200 8N1, no flow control, bytes as they are (protocol 2/2, §2.2.2); a read returns what there is.
_INPUT = (
    termios.IGNBRK | termios.BRKINT | termios.PARMRK | termios.INPCK | termios.ISTRIP
    | termios.INLCR | termios.IGNCR | termios.ICRNL
)  # fmt: skip
_SOFTWARE = termios.IXON | termios.IXOFF | termios.IXANY
_FORMAT = termios.CSIZE | termios.CSTOPB | termios.PARENB | termios.CREAD | termios.CLOCAL | termios.CRTSCTS
_LOCAL = termios.ICANON | termios.ISIG | termios.IEXTEN | termios.ECHO | termios.ECHONL
#: Bits that are ours, by tcgetattr's index: (which, what they must be).
_OURS: tuple[tuple[int, int], ...] = (
    (_INPUT | _SOFTWARE, 0),
    (termios.OPOST, 0),
    (_FORMAT, termios.CS8 | termios.CREAD | termios.CLOCAL),
    (_LOCAL, 0),
)
_SPEED = termios.B19200
#: (index, bits, their value, words for it); None: any value but the one that they must have.
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
_N_TTY = 0  #: the line discipline for bytes as they are; others make packets of them (`ldattach`, `slattach`, `pppd`)
_TIOCGEXCL = 0x80045440  #: asm-generic/ioctls.h
_UNKNOWN = (errno.ENOTTY, errno.EINVAL)


def restore(fd: int, tolerated: str = "") -> str:
    """Set the port up again where somebody has changed it; what was found, "" where all was well.

    `tolerated`: what it differs by because its driver takes no better. Output that was suspended goes on.
    Raises OSError or termios.error for a port that is gone.
    """
    found = [words] if (words := take_back(fd)) else []
    *flags, characters = termios.tcgetattr(fd)
    words = differences(flags, characters)
    if words and words != tolerated:
        set_up(fd)
        found.append(words)
    # Nobody can ask whether it is suspended (TCOOFF, or an XOFF that came in); going on is harmless.
    termios.tcflow(fd, termios.TCOON)
    return ", ".join(found)


def take_back(fd: int) -> str:
    """Set the line discipline for bytes as they are; which other one was found, "" where all was well.

    With some others (N_NULL) a tty does not even answer that it is one, and takes no byte: so this comes before
    anything else is asked. What is no tty has none, and stays as it is. OSError for a port that is gone.
    """
    discipline = _number(fd, termios.TIOCGETD)
    if discipline == _N_TTY:
        return ""
    fcntl.ioctl(fd, termios.TIOCSETD, _N_TTY.to_bytes(4, sys.byteorder))
    return f"line discipline {discipline}"


def set_up(fd: int) -> None:
    """Set the line to 19200 8N1; what is none of ours stays. OSError or termios.error for a port that is gone."""
    attributes = termios.tcgetattr(fd)
    for at, (bits, value) in enumerate(_OURS):
        attributes[at] = attributes[at] & ~bits | value
    attributes[4] = attributes[5] = _SPEED
    attributes[6][termios.VMIN] = attributes[6][termios.VTIME] = 0
    termios.tcsetattr(fd, termios.TCSANOW, attributes)


def share(fd: int) -> str:
    """Allow others to open the port again, should somebody have forbidden it: a stop tool must; what was found."""
    if not _number(fd, _TIOCGEXCL):
        return ""
    fcntl.ioctl(fd, termios.TIOCNXCL)
    return "one program's alone (TIOCEXCL)"


def differences(flags: Sequence[int], characters: Sequence[bytes | int]) -> str:
    """What of these settings is not as a charger needs it, for people: "115200 baud, echo on"; "" if all is well.

    `flags` and `characters` are the first six and the last of what termios.tcgetattr gives.
    """
    speeds = sorted({flags[4], flags[5]} - {_SPEED})
    found = [f"{_BAUDS.get(speed, 'an odd number of')} baud" for speed in speeds]
    for at, bits, value, words in _WORDS:
        has, must = flags[at] & bits, _OURS[at][1] & bits
        if (has != must) if value is None else (has == value):
            found.append(words)
    # They are characters, and mean something else, where lines are edited; that is told above.
    if any(isinstance(count, int) and count for count in (characters[termios.VMIN], characters[termios.VTIME])):
        found.append("reads that wait for more")
    return ", ".join(found)


def _number(fd: int, question: int) -> int:
    """What the kernel answers to a question for an int; 0 where the driver does not know it."""
    answer = bytearray(4)
    try:
        fcntl.ioctl(fd, question, answer)
    except OSError as error:
        if error.errno not in _UNKNOWN:
            raise
    return int.from_bytes(answer, sys.byteorder)
