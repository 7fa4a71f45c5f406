"""The virtual kernel's calls for serial ports, GPIO lines and locks."""

import errno
import fcntl
import os
import sys
import termios
from typing import Any

from orchestrator.lastresort.lastopen import GET_LINE, SET_VALUES
from tests.proof.virtual_descriptors import Descriptors
from tests.proof.virtual_disk import Inode, fails
from tests.proof.virtual_files import File
from tests.proof.virtual_gpio import Chip, Output, request_line, set_values
from tests.proof.virtual_tty import Tty

TIOCGEXCL = 0x80045440  #: asm-generic/ioctls.h


class TtyCalls(Descriptors):
    """`ioctl`, `flock` and the calls of `termios`."""

    def _tty(self, fd: int) -> Tty:
        what = self.file(fd).what
        if not isinstance(what, Tty):
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        return what

    def ioctl(self, fd: int, request: int = 0, argument: Any = 0, *_: object) -> int:
        file = self.file(fd)
        if isinstance(file.what, Chip | Output):
            self.calls("ioctl", file.path)
            return self._ioctl_line(file, request, argument)
        tty = self._tty(fd)
        self.calls("ioctl", file.path)
        if request in (termios.TIOCEXCL, termios.TIOCNXCL):
            tty.exclusive = request == termios.TIOCEXCL
        elif request == TIOCGEXCL:
            argument[:4] = int(tty.exclusive).to_bytes(4, sys.byteorder)
        return 0

    def _ioctl_line(self, file: File, request: int, argument: Any) -> int:
        if not self.chips[file.path.split(":")[0]].present:
            raise fails(errno.ENODEV, file.path)
        if isinstance(file.what, Chip) and request == GET_LINE:
            return request_line(self, file.what, file.path, argument)
        if isinstance(file.what, Output) and request == SET_VALUES:
            return set_values(file.what, argument)
        raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))

    def flock(self, fd: int, operation: int) -> None:
        file = self.file(fd)
        what = file.what
        assert isinstance(what, Tty | Inode)
        if operation & fcntl.LOCK_UN:
            what.lock = None if what.lock is file else what.lock
            return
        self.calls("flock", file.path)
        file.locker = self.me
        while what.lock not in (None, file):
            if operation & fcntl.LOCK_NB:
                raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
            self.time.wait(self.time.now_s + 0.1)
        what.lock = file

    def _tty_call(self, name: str, fd: Any) -> Tty:
        try:
            tty = self._tty(self.number(fd))
        except OSError as error:
            raise termios.error(error.errno, error.strerror) from None
        self.calls(name, self.file(fd).path)
        if not tty.present:
            raise termios.error(errno.EIO, os.strerror(errno.EIO))
        return tty

    def tcgetattr(self, fd: Any) -> list[Any]:
        return self._tty_call("tcgetattr", fd).shown()

    def tcsetattr(self, fd: Any, _when: int, settings: list[Any]) -> None:
        self._tty_call("tcsetattr", fd).set(settings)

    def tcflush(self, fd: Any, queue: int) -> None:
        tty = self._tty_call("tcflush", fd)
        if queue in (termios.TCIFLUSH, termios.TCIOFLUSH):
            tty.waiting_bytes = b""
        if queue in (termios.TCOFLUSH, termios.TCIOFLUSH):
            tty.held_back.clear()
