"""A charger on a pty, written from its protocol document; it shares no code with the product.

It obeys in manual mode like the real one, and its line can be made as bad as a real line.
"""

import os
import random
import select
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

from tests.link.ptys import Pty

REST_STOP = bytes.fromhex("AF FA 90 04 10 90 00 34 AF A0")
REST_RESUME = bytes.fromhex("AF FA 90 04 10 90 01 35 AF A0")
OPERATION_STOP = bytes.fromhex("AF FA 90 05 02 90 01 00 28 AF A0")
RUN = bytes.fromhex("AF FA 90 05 02 90 01 01 29 AF A0")
STEP_2 = bytes.fromhex("AF FA 90 05 02 90 02 01 2A AF A0")
POLL = bytes.fromhex("AF FA 90 05 01 90 13 1F 58 AF A0")

#: A line: the reply → the parts that reach the product, each after a pause in seconds.
Shape = Callable[[bytes, random.Random], list[tuple[float, bytes]]]


def perfect(reply: bytes, _: random.Random) -> list[tuple[float, bytes]]:
    return [(0.0, reply)]


def bytewise(reply: bytes, _: random.Random) -> list[tuple[float, bytes]]:
    return [(0.0005, reply[at : at + 1]) for at in range(len(reply))]


def delayed(pause_s: float) -> Shape:
    return lambda reply, _: [(pause_s, reply)]


def always(answer: bytes) -> Shape:
    """Always sends this instead."""
    return lambda _reply, _dice: [(0.0, answer)]


def broken(reply: bytes, _: random.Random) -> list[tuple[float, bytes]]:
    return [(0.0, reply[:-1] + b"\x00")]


def lossy(share: float) -> Shape:
    """Damages this share of all replies: one byte is lost, or all of them."""

    def lose(reply: bytes, dice: random.Random) -> list[tuple[float, bytes]]:
        if dice.random() >= share:
            return [(0.0, reply)]
        at = dice.randrange(2 * len(reply))
        return [(0.0, reply[:at] + reply[at + 1 :])] if at < len(reply) else []

    return lose


def garbage(reply: bytes, dice: random.Random) -> list[tuple[float, bytes]]:
    """Noise before, between and after, with false start and end bytes in it."""
    noise = dice.choice([dice.randbytes(7), b"\xaf", b"\xaf\xfa\x90", b"\xaf\xa0\xaf\xfa\x00", reply[:9]])
    return [(0.0, noise + reply), (0.001, dice.randbytes(3))]


class FakeCharger:
    """`frames` holds everything it received, with timestamps."""

    def __init__(self, pty: Pty, shape: Shape = perfect, *, echo: bool = False) -> None:
        self.pty = pty
        self.shape = shape
        self.echo = echo  #: as an RS-485 adapter that hears itself
        self.mute = False  #: receives but never answers
        self.baud: int | None = None  #: understands only this speed (a termios constant); None: any
        self.manual = True
        self.running = self.limit = self.mode = self.precharge = 0
        self.standby = False
        self.volts = 50.11
        self.frames: list[tuple[float, bytes]] = []
        self._dice = random.Random(20260)
        self._ended = Event()
        self._reading = Event()
        self._reading.set()
        self._paused = Event()
        self._thread = Thread(target=self._serve, daemon=True)
        self._thread.start()

    @property
    def commands(self) -> list[bytes]:
        """Everything received but the polls."""
        return [frame for _, frame in self.frames if frame[4] != 0x01]

    @property
    def polls(self) -> int:
        return len(self.frames) - len(self.commands)

    def say(self, data: bytes) -> None:
        """Send something unsolicited."""
        os.write(self.pty.master, data)

    @contextmanager
    def babbling(self) -> Iterator[None]:
        """Send noise without a pause, as fast as the line takes it."""
        over = Event()
        noise = self._dice.randbytes(4096)

        def babble() -> None:
            while not over.is_set():
                self.say(noise)

        thread = Thread(target=babble, daemon=True)
        thread.start()
        yield
        over.set()
        thread.join()

    def stop_reading(self) -> None:
        """Stop reading from the line."""
        self._reading.clear()
        self._paused.wait()

    def go_on_reading(self) -> None:
        self._paused.clear()
        self._reading.set()

    def end(self) -> None:
        self._ended.set()
        self._reading.set()
        self._thread.join()

    def _serve(self) -> None:
        pending = b""
        while not self._ended.is_set():
            if not self._reading.is_set():
                self._paused.set()
                self._reading.wait()
                continue
            try:
                if select.select([self.pty.master], [], [], 0.02)[0]:
                    pending = self._receive(pending + self._hear())
            except (OSError, ValueError):  # unplugged
                self._ended.wait(0.01)

    def _hear(self) -> bytes:
        """What a receiver understands of it: at another speed, nothing."""
        heard = self.baud is None or self.baud == termios.tcgetattr(self.pty.master)[5]  # both ends share one setting
        data = os.read(self.pty.master, 4096)
        return data if heard else b""

    def _receive(self, pending: bytes) -> bytes:
        while len(pending) >= 4 and len(pending) >= pending[3] + 6:
            frame, pending = pending[: pending[3] + 6], pending[pending[3] + 6 :]
            self.frames.append((time.monotonic(), frame))
            assert frame[:3] == b"\xaf\xfa\x90", frame.hex()
            assert frame[-2:] == b"\xaf\xa0", frame.hex()
            assert frame[-3] == sum(frame[2:-3]) & 0xFF, frame.hex()
            if self.echo:
                self.say(frame)
            self._obey(frame)
        return pending

    def _obey(self, frame: bytes) -> None:
        command, data = frame[4], frame[6:-3]
        if command == 0x01 and not self.mute:
            for pause_s, part in self.shape(self._reply(*data), self._dice):
                if pause_s:
                    self._ended.wait(pause_s)
                self.say(part)
        elif command == 0x10:
            self.standby = data[0] == 0
            if self.standby:
                self.running = 0
        elif command == 0x02 and self.manual:
            push, value = data
            name = {1: "running", 2: "limit", 4: "mode", 8: "precharge"}[push]
            setattr(self, name, value)

    def _reply(self, kind1: int, kind2: int) -> bytes:
        raw = round(self.volts * 100)
        values = {
            (0, 0): raw, (0, 1): 0, (0, 2): 0, (0, 3): 0, (0, 4): int(self.manual),
            (1, 0): self.running, (1, 1): self.limit, (1, 2): self.mode or 5, (1, 3): self.precharge, (1, 4): 1,
        }  # fmt: skip
        data = b"".join(
            value.to_bytes(2, "big") for (kind, bit), value in values.items() if (kind1, kind2)[kind] >> bit & 1
        )
        counted = bytes((0x90, len(data) + 3, 0x03, 0x90)) + data
        return b"\xaf\xfa" + counted + bytes((sum(counted) & 0xFF,)) + b"\xaf\xa0"


@contextmanager
def charger_on(pty: Pty, shape: Shape = perfect, *, echo: bool = False) -> Iterator[FakeCharger]:
    charger = FakeCharger(pty, shape, echo=echo)
    try:
        yield charger
    finally:
        charger.end()
