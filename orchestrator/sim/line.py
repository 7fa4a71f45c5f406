"""The effects of a serial line on its bytes."""

import random
import termios
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

#: One byte at 19200 baud with start and stop bit (§2.2.2).
BYTE_S = 10 / 19200


@dataclass(frozen=True, slots=True)
class SimulatedLine:
    """A kind of line; the default is perfect and takes no time."""

    byte_s: float = 0.0  #: time per byte, `BYTE_S` for a real line
    answer_s: float = 0.002  #: how long the charger takes before it answers
    bytewise: bool = False  #: answers arrive byte by byte, not frame by frame
    loss: float = 0.0  #: share of frames, in both directions, that lose one byte
    lost: float = 0.0  #: share of frames, in both directions, lost entirely
    wrong: float = 0.0  #: share of frames, in both directions, with one byte changed
    garbage: float = 0.0  #: share of frames, in both directions, preceded by garbage
    echo: bool = False  #: an RS-485 adapter that echoes what it sends
    seed: int = 1


#: The lines used in tests.
LINES = {
    "perfect": SimulatedLine(),
    "real": SimulatedLine(byte_s=BYTE_S),
    "bytewise": SimulatedLine(byte_s=BYTE_S, bytewise=True),
    "delayed": SimulatedLine(answer_s=0.08),
    "lossy": SimulatedLine(loss=0.05),
    "garbage": SimulatedLine(garbage=0.5),
    "echo": SimulatedLine(echo=True),
    "poor": SimulatedLine(byte_s=BYTE_S, lost=0.01, wrong=0.001),
}


def is_clear(settings: Sequence[object]) -> bool:
    """Whether a port with these settings (of `termios.tcgetattr`) passes bytes to and from a charger unchanged."""
    iflag, oflag, cflag, lflag, _, speed = cast("Sequence[int]", settings[:6])
    framed = cflag & (termios.CSIZE | termios.PARENB | termios.CSTOPB | termios.CRTSCTS | termios.CREAD)
    changed = iflag & (termios.ISTRIP | termios.ICRNL | termios.IXON) or oflag & termios.OPOST or lflag & termios.ICANON
    return speed == termios.B19200 and framed == termios.CS8 | termios.CREAD and not changed


def garbled(data: bytes) -> bytes:
    """What a receiver makes of bytes sent at another speed or in another format: fewer bytes, with other values."""
    return bytes(byte * 37 + 101 & 0xFF for byte in data[::2])


class Noise:
    """Spoils frames as its line does; the same seed spoils the same frames."""

    def __init__(self, line: SimulatedLine) -> None:
        self._line = line
        self._random = random.Random(line.seed)  # noqa: S311 - noise, not a secret

    def spoil(self, frame: bytes) -> bytes:
        """The frame as it arrives; b"" if it is lost."""
        line, dice = self._line, self._random
        if line.lost and dice.random() < line.lost:
            return b""
        if line.wrong and dice.random() < line.wrong:
            at = dice.randrange(len(frame))
            frame = frame[:at] + bytes((frame[at] ^ dice.randint(1, 0xFF),)) + frame[at + 1 :]
        if line.loss and dice.random() < line.loss:
            gap = dice.randrange(len(frame))
            frame = frame[:gap] + frame[gap + 1 :]
        if line.garbage and dice.random() < line.garbage:
            frame = dice.choice((b"", b"\xaf", b"\xaf\xfa", b"\xaf\xa0")) + dice.randbytes(dice.randint(1, 16)) + frame
        return frame
