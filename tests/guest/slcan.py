"""A serial CAN adapter that can be pulled out: the kernel's slcan driver and the emulated BMU, each on a pty of its own.

Between the two ptys stands a relay, which is the adapter: it hands on the lines that both sides speak, and says what an
adapter says by itself.
"""

import fcntl
import os
import select
import struct
import termios
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from tests.guest.stage import ip, switch

N_SLCAN = 17  #: the line discipline (linux/tty.h)
SIOCGIFNAME = 0x8910
#: What an adapter says of its controller: s, the state's letter, three digits of receive and transmit errors each.
BUS_OFF = b"sb000255\r"
ACTIVE = b"sa000000\r"


class Adapter:
    """`interface` is the kernel's name for it; `theirs` is how python-can reaches the other side."""

    def __init__(self) -> None:
        self._far, self._far_tty = os.openpty()
        tty.setraw(self._far_tty)
        self._near = self._near_tty = -1
        self.interface = ""
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._relay = threading.Thread(target=self._run, daemon=True)
        self.plug()
        self._relay.start()

    @property
    def theirs(self) -> dict[str, Any]:
        path = os.ttyname(self._far_tty)
        return {"interface": "slcan", "channel": path, "bitrate": 250000, "sleep_after_open": 0, "timeout": 0.01}

    def plug(self) -> None:
        """Attach the driver and bring the interface up, as slcand and networkd do."""
        near, self._near_tty = os.openpty()
        tty.setraw(self._near_tty)
        fcntl.ioctl(self._near_tty, termios.TIOCSETD, struct.pack("i", N_SLCAN))
        name = fcntl.ioctl(self._near_tty, SIOCGIFNAME, bytes(16))
        self.interface = name.partition(b"\0")[0].decode()
        ip("link", "set", self.interface, "type", "can", "bitrate", "250000")
        switch(self.interface, up=True)
        with self._lock:
            self._near = near

    def unplug(self) -> None:
        """The interface is gone afterwards."""
        with self._lock:
            near, self._near = self._near, -1
        os.close(near)
        os.close(self._near_tty)

    def say(self, line: bytes) -> None:
        """Let the adapter tell the kernel something."""
        os.write(self._near, line)

    def close(self) -> None:
        self._ended.set()
        self._relay.join()
        if self._near >= 0:
            self.unplug()
        os.close(self._far)
        os.close(self._far_tty)

    def _run(self) -> None:
        while not self._ended.is_set():
            with self._lock:
                near = self._near
                ends = {near: self._far, self._far: near} if near >= 0 else {self._far: -1}
                ready, _, _ = select.select(list(ends), [], [], 0.01)
                for end in ready:
                    with suppress(OSError):  # nobody has it open at the moment
                        data = os.read(end, 4096)
                        if ends[end] >= 0:
                            os.write(ends[end], data)


@contextmanager
def slcan() -> Iterator[Adapter]:
    adapter = Adapter()
    try:
        yield adapter
    finally:
        adapter.close()
