"""A serial CAN adapter that can be unplugged.

The kernel's slcan driver and the emulated BMU each have a pty. The relay between them plays the adapter: it passes
lines between both sides and sends an adapter's own messages.
"""

import fcntl
import os
import struct
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from orchestrator.sim.background import Background
from tests.guest.stage import switch

N_SLCAN = 17  #: the line discipline (linux/tty.h)
SIOCGIFNAME = 0x8910
#: An adapter's report on its controller: s, the state's letter, three digits each of receive and transmit errors.
BUS_OFF = b"sb000255\r"
ACTIVE = b"sa000000\r"


class Adapter:
    """`interface` is its kernel name; `theirs` is python-can's channel to the other side."""

    def __init__(self, background: Background) -> None:
        self._background = background
        self._far, self._far_tty = _pty()
        self._near = self._near_tty = -1
        self.interface = ""
        self.plug()

    @property
    def theirs(self) -> dict[str, Any]:
        path = os.ttyname(self._far_tty)
        return {"interface": "slcan", "channel": path, "bitrate": 250000, "sleep_after_open": 0, "timeout": 0.01}

    def plug(self) -> None:
        """Attach the driver and bring the interface up, as slcand does; the bit rate is left to the adapter."""
        self._near, self._near_tty = _pty()
        fcntl.ioctl(self._near_tty, termios.TIOCSETD, struct.pack("i", N_SLCAN))
        self.interface = fcntl.ioctl(self._near_tty, SIOCGIFNAME, bytes(16)).partition(b"\0")[0].decode()
        self._background.call(self._hand_on)
        switch(self.interface, up=True)

    def unplug(self) -> None:
        """Remove the interface."""
        if self._near >= 0:
            self._background.call(self._hold_back)
            os.close(self._near)
            os.close(self._near_tty)
            self._near = -1

    def say(self, line: bytes) -> None:
        """Send a message of the adapter to the kernel."""
        os.write(self._near, line)

    def close(self) -> None:
        self.unplug()
        os.close(self._far)
        os.close(self._far_tty)

    def _hand_on(self) -> None:
        self._background.loop.add_reader(self._near, _copy, self._near, self._far)
        self._background.loop.add_reader(self._far, _copy, self._far, self._near)

    def _hold_back(self) -> None:
        self._background.loop.remove_reader(self._near)
        self._background.loop.remove_reader(self._far)


def _pty() -> tuple[int, int]:
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    return master, slave


def _copy(source: int, target: int) -> None:
    with suppress(OSError):  # a line without a reader buffers nothing
        os.write(target, os.read(source, 4096))


@contextmanager
def slcan() -> Iterator[Adapter]:
    with Background() as background:
        adapter = Adapter(background)
        try:
            yield adapter
        finally:
            adapter.close()
