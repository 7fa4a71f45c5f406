"""A serial port made of a pty, under a stable name, that can be unplugged, plugged in again and stalled."""

import os
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class Pty:
    """The device's end is `master`; the product opens `path`, a symbolic link as below /dev/serial/by-path."""

    def __init__(self, link: Path) -> None:
        self._link = link
        self._ours: int | None = None
        self.path = str(link)
        self.master = -1
        self.plug()

    def plug(self) -> None:
        # The pty's other end stays open here, so that the master never reads EIO while the product has it closed.
        self.master, self._ours = os.openpty()
        tty.setraw(self._ours)
        self._link.symlink_to(os.ttyname(self._ours))

    def unplug(self) -> None:
        if self._ours is not None:
            self._link.unlink()
            os.close(self.master)
            os.close(self._ours)
            self._ours = None

    def fill(self) -> int:
        """Write towards the device, which does not read, until nothing more goes in."""
        assert self._ours is not None
        os.set_blocking(self._ours, False)
        filled = 0
        try:
            while True:
                filled += os.write(self._ours, bytes(4096))
        except BlockingIOError:
            return filled


@contextmanager
def plugged(link: Path) -> Iterator[Pty]:
    pty = Pty(link)
    try:
        yield pty
    finally:
        pty.unplug()
