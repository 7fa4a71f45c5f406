"""A serial port in memory: bytes in and out, settings anyone may change, the lock, its readers and writers."""

import termios
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from orchestrator.sim.line import garbled, is_clear
from tests.proof.virtual_threads import Waiting
from tests.proof.virtual_time import Time

#: The capacity of a tty.
ROOM = 4096
#: The bits of `c_cflag` that are the speed.
SPEED = 0o010017
VMIN, VTIME = termios.VMIN, termios.VTIME

Attributes = list[Any]  #: as from `termios.tcgetattr`
#: Name in `stty` → the index in `termios.tcgetattr`, the bits (or character), and their value.
STTY: dict[str, tuple[int, int, int]] = {
    "parenb": (2, termios.PARENB | termios.PARODD, termios.PARENB),
    "parodd": (2, termios.PARENB | termios.PARODD, termios.PARENB | termios.PARODD),
    "cstopb": (2, termios.CSTOPB, termios.CSTOPB),
    "cs7": (2, termios.CSIZE, termios.CS7),
    "crtscts": (2, termios.CRTSCTS, termios.CRTSCTS),
    "-cread": (2, termios.CREAD, 0),
    "ixon": (0, termios.IXON, termios.IXON),
    "istrip": (0, termios.ISTRIP, termios.ISTRIP),
    "opost": (1, termios.OPOST, termios.OPOST),
    "icanon": (3, termios.ICANON, termios.ICANON),
    "min": (6, VMIN, 255),
    "time": (6, VTIME, 50),
}


def fresh_attributes() -> Attributes:
    """A port not configured yet: 9600 baud, line by line, the kernel's defaults."""
    return [
        termios.ICRNL | termios.IXON,
        termios.OPOST | termios.ONLCR,
        termios.B9600 | termios.CS8 | termios.CREAD | termios.HUPCL,
        termios.ISIG | termios.ICANON | termios.ECHO | termios.ECHOE | termios.IEXTEN,
        termios.B9600,
        termios.B9600,
        [b"\0"] * 32,
    ]


@dataclass(slots=True)
class Tty:
    """One port. `listener` gets the bytes written to it; `deliver` brings bytes in."""

    time: Time
    present: bool = True
    stalled: bool = False  #: accepts no more output
    stolen: bool = False  #: another program reads all input
    suspended: bool = False  #: another program has stopped its output (TCOOFF); writes wait
    held_back: list[bytes] = field(default_factory=list)
    waiting_bytes: bytes = b""
    attributes: Attributes = field(default_factory=fresh_attributes)
    changed_s: float = 0.0  #: when another program changed them
    listener: Callable[[bytes], None] = lambda _: None
    on_written: Callable[[bytes], None] = lambda _: None  #: bytes written by our processes, received or not
    on_delivered: Callable[[int], None] = lambda _: None  #: number of bytes received
    exclusive: bool = False  #: TIOCEXCL: opening is refused
    opened: int = 0  #: number of open files
    lock: object = None  #: the open file holding its lock, or a foreign program
    news: Waiting = field(init=False)

    def __post_init__(self) -> None:
        self.news = Waiting(self.time)

    @property
    def clear(self) -> bool:
        """Whether both ends have the same settings."""
        return is_clear(self.attributes)

    def take(self, data: bytes) -> None:
        """Bytes go out."""
        self.on_written(data)
        if self.suspended:
            self.held_back.append(data)
        else:
            self.listener(data if self.clear else garbled(data))

    def flow(self, *, goes: bool) -> None:
        """`tcflow`."""
        self.suspended = not goes
        waiting, self.held_back = (self.held_back, []) if goes else ([], self.held_back)
        for data in waiting:
            self.listener(data if self.clear else garbled(data))

    @property
    def readable(self) -> bool:
        """Like n_tty's poll: without a time (VTIME), VMIN bytes must be available."""
        characters = self.shown()[6]
        raw = not self.attributes[3] & termios.ICANON
        least = characters[VMIN] if raw and not characters[VTIME] else 1
        return len(self.waiting_bytes) >= max(int(least), 1)

    def deliver(self, data: bytes) -> None:
        """Bytes come in."""
        if not (self.present and self.opened) or self.stolen:
            return
        if not self.clear:
            if self.attributes[3] & termios.ICANON:
                return  # until the end of a line, which garbage does not contain
            data = garbled(data)
        self.waiting_bytes = (self.waiting_bytes + data)[:ROOM]
        self.news.wake()
        self.on_delivered(len(data))

    def unplug(self) -> None:
        self.present, self.waiting_bytes = False, b""
        self.news.wake()

    def plug(self) -> None:
        """A new device, neither configured nor locked."""
        if not self.present:
            self.present, self.attributes, self.exclusive = True, fresh_attributes(), False

    # --- other programs -----------------------------------------------------------------------------------------------

    def taken_over(self, speed: int, *, line_by_line: bool = False) -> None:
        """`stty -F PORT SPEED`, or a getty."""
        settings = fresh_attributes() if line_by_line else [*self.attributes[:6], [b"\0"] * 32]
        settings[2] = (settings[2] & ~SPEED) | speed
        settings[4] = settings[5] = speed
        self.attributes, self.changed_s = settings, self.time.now_s

    def altered(self, what: str) -> None:
        """`stty -F PORT …`, one word of it."""
        at, bits, value = STTY[what]
        settings = [*self.attributes[:6], list(self.attributes[6])]
        if at == 6:
            settings[6][bits] = value
        else:
            settings[at] = settings[at] & ~bits | value
        self.attributes, self.changed_s = settings, self.time.now_s

    def set(self, settings: Attributes) -> None:
        """`tcsetattr`."""
        kept = [*settings[:6], list(settings[6])]
        kept[5] = kept[5] or termios.B9600
        kept[2] = (kept[2] & ~SPEED) | kept[5]
        self.attributes = kept

    def shown(self) -> Attributes:
        """`tcgetattr`: VMIN and VTIME are numbers where they apply."""
        kept = [*self.attributes[:6], list(self.attributes[6])]
        if not kept[3] & termios.ICANON:
            for at in (VMIN, VTIME):
                value = kept[6][at]
                kept[6][at] = value if isinstance(value, int) else value[0]
        return kept
