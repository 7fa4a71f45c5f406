"""A serial port made of a pty with a stable name; it can be unplugged, plugged in again and stalled."""

import os
import select
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


class Pty:
    """The device's end is `master`; the product opens `path`, a symbolic link as in /dev/serial/by-path."""

    def __init__(self, link: Path) -> None:
        self._link = link
        self._ours: int | None = None
        self.path = str(link)
        self.master = -1
        self.plug()

    def plug(self) -> None:
        # The pty's other end stays open here, so the master never reads EIO while the product has it closed.
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
        """Write towards the device, which does not read, until the buffer is full."""
        assert self._ours is not None
        os.set_blocking(self._ours, False)
        writable = select.poll()
        writable.register(self._ours, select.POLLOUT)
        filled = 0
        while writable.poll(100):  # the kernel passes writes on a little later, which makes room again
            with suppress(BlockingIOError):
                filled += os.write(self._ours, bytes(4096))
        with suppress(BlockingIOError):  # "writable" means room for more than a frame
            while True:
                filled += os.write(self._ours, bytes(1))
        return filled

    def drain(self) -> bytes:
        """Everything at the device's end not yet read."""
        everything = b""
        os.set_blocking(self.master, False)
        with suppress(BlockingIOError):
            while data := os.read(self.master, 65536):
                everything += data
        os.set_blocking(self.master, True)
        return everything


@contextmanager
def plugged(link: Path) -> Iterator[Pty]:
    pty = Pty(link)
    try:
        yield pty
    finally:
        pty.unplug()
