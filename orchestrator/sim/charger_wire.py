"""An emulated charger on a pseudo-terminal: real bytes on a real tty, served by an asyncio loop."""

import asyncio
import fcntl
import os
import termios
import tty
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from termios import tcgetattr

from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.charger_frames import (
    CHECKSUM_ERROR,
    REST,
    SET,
    STATUS,
    Ear,
    Kind,
    Lie,
    Request,
    complaint,
    status,
)
from orchestrator.sim.line import Noise, SimulatedLine, garbled, is_clear

#: A frame interrupted for this long (about 60 byte times) is cut off.
FRAME_GAP_S = 0.03


@dataclass(slots=True)
class Counters:
    """What arrived on the line since it was opened; times are `time.monotonic()`."""

    polls: int = 0
    orders: int = 0
    stops: int = 0
    resumes: int = 0
    bad: int = 0
    first_byte_s: float | None = None  #: the first byte since `mark()`
    first_stop_s: float | None = None  #: the first stop frame (0x10, rest 0) since `mark()`

    def mark(self) -> None:
        """Start waiting again for the first byte and the first stop frame."""
        self.first_byte_s = self.first_stop_s = None


class ChargerWire:
    """Serves one charger model on a pty.

    `now()` is called before each request takes effect, so that the model can catch up. All methods belong to the loop's
    thread.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        charger: SimulatedCharger,
        *,
        line: SimulatedLine | None = None,
        link: Path | None = None,
        now: Callable[[], None] = lambda: None,
    ) -> None:
        self.charger = charger
        self.counters = Counters()
        self.mute_rx = False  #: receives nothing
        self.mute_tx = False  #: sends nothing
        self.complains = False  #: answers every frame with 0x1F, checksum error
        self.lies: dict[Kind, int] = {}  #: false values in every status reply
        self.liars: dict[Kind, Lie] = {}  #: false values in some status replies
        self.on_bytes: Callable[[float, bytes], None] | None = None  #: called with (monotonic s, bytes) on arrival
        self.path = ""
        self._loop = loop
        self._line = line or SimulatedLine()
        self._noise = Noise(self._line)
        self._link = link
        self._now = now
        self._ear = Ear()
        self._cut_off: asyncio.TimerHandle | None = None
        self._master = self._slave = self._stranger = -1

    # --- the port ---

    def open(self) -> None:
        """Create the pty, and the link to it if wanted. Setting up the line is the client's task."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)  # keeping it open also keeps the line up while no client has it open
        self.set_speed(termios.B9600)  # like a port that nothing has set up yet
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        if self._link is not None:
            fresh = self._link.with_name(self._link.name + ".new")
            fresh.unlink(missing_ok=True)
            fresh.symlink_to(self.path)
            fresh.rename(self._link)
        self._loop.add_reader(self._master, self._on_readable)

    def close(self) -> None:
        """Remove the pty and its link, as if the adapter were unplugged."""
        if self._master < 0:
            return
        self._loop.remove_reader(self._master)
        os.close(self._master)
        os.close(self._slave)
        self.unlock()
        self._master = self._slave = -1
        self._ear.forget()
        if self._link is not None:
            self._link.unlink(missing_ok=True)

    @property
    def is_open(self) -> bool:
        """Whether the port is there."""
        return self._master >= 0

    # --- other programs on the same machine ---

    def set_speed(self, speed: int) -> None:
        """Another program sets the port to this speed, one of `termios.B…`."""
        settings = tcgetattr(self._slave)
        settings[4] = settings[5] = speed
        termios.tcsetattr(self._slave, termios.TCSANOW, settings)

    def lock(self) -> None:
        """Another program opens the port and locks it."""
        if self._stranger < 0 <= self._slave:
            self._stranger = os.open(self.path, os.O_RDWR | os.O_NOCTTY)
            try:
                fcntl.flock(self._stranger, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:  # the service holds the lock, so the other program cannot have it
                self.unlock()

    def unlock(self) -> None:
        """The other program closes the port again."""
        if self._stranger >= 0:
            os.close(self._stranger)
            self._stranger = -1

    @property
    def is_clear(self) -> bool:
        """Whether the port's settings match the charger's; otherwise both sides receive garbage."""
        return is_clear(tcgetattr(self._slave))

    # --- hearing ---

    def _on_readable(self) -> None:
        now_s = self._loop.time()
        try:
            chunk = os.read(self._master, 4096)
        except OSError:  # a client closed the port with bytes unread; the port itself stays
            return
        if self.counters.first_byte_s is None:
            self.counters.first_byte_s = now_s
        if self.on_bytes is not None:
            self.on_bytes(now_s, chunk)
        if self._line.echo:
            self._write(chunk)
        if self.mute_rx:
            return
        chunk = chunk if self.is_clear else garbled(chunk)
        if self._line.byte_s:
            self._loop.call_later(len(chunk) * self._line.byte_s, self._hear, now_s, chunk)
        else:
            self._hear(now_s, chunk)

    def _hear(self, came_s: float, chunk: bytes) -> None:
        for request in self._ear.hear(self._noise.spoil(chunk)):
            self._now()
            self._obey(request, came_s)
        if self._cut_off is not None:
            self._cut_off.cancel()
            self._cut_off = None
        if self._ear.waiting:
            self._cut_off = self._loop.call_later(FRAME_GAP_S, self._give_up)

    def _give_up(self) -> None:
        self._cut_off = None
        self.counters.bad += self._ear.forget() > 0

    def _obey(self, request: Request, came_s: float) -> None:
        counters = self.counters
        if request.errors or self.complains:
            counters.bad += request.errors != 0
            self._say(complaint(request, request.errors or CHECKSUM_ERROR))
        elif request.command == STATUS:
            counters.polls += 1
            kind1, kind2 = request.data
            told = {kind: lie.value for kind, lie in self.liars.items() if lie.is_told()}
            self._say(status(self.charger, kind1, kind2, {**self.lies, **told}))
        elif request.command == SET:
            counters.orders += 1
            self.charger.push(*request.data)
        elif request.command == REST:
            value = request.data[0]
            counters.stops += value == 0
            counters.resumes += value == 1
            if value == 0 and counters.first_stop_s is None:
                counters.first_stop_s = came_s
            self.charger.rest(value)

    # --- saying ---

    def _say(self, answer: bytes) -> None:
        if self.mute_tx:
            return
        line, heard = self._line, self._noise.spoil(answer)
        if line.bytewise:
            for count in range(len(heard)):
                due_s = line.answer_s + (count + 1) * line.byte_s
                self._loop.call_later(due_s, self._write, heard[count : count + 1])
        else:
            self._loop.call_later(line.answer_s + len(heard) * line.byte_s, self._write, heard)

    def _write(self, data: bytes) -> None:
        if self._master >= 0:
            try:
                os.write(self._master, data if self.is_clear else garbled(data))
            except OSError:  # no reader: a wire does not store what nobody receives
                return
