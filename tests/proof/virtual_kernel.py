"""The kernel below the unchanged service, call by call, in virtual time: serial ports, files, sockets, standard error.

Every call goes through `Calls`, so any of them can be made to fail as in a real kernel, or to take time: then only the
calling thread waits. Descriptors belong to processes; a killed process loses its threads in the middle of their work,
its descriptors and its locks.
"""

import fcntl
import os
import select
import termios
from types import SimpleNamespace

from tests.proof.virtual_file_calls import FileCalls
from tests.proof.virtual_waits import Poll, Waits


class Kernel(FileCalls, Waits):
    """Ports, files and sockets, and the calls of `os`, `fcntl`, `termios`, `select` and `socket` for them."""

    def modules(self) -> dict[str, SimpleNamespace]:
        fake_os = SimpleNamespace(**vars(os))
        for name in (
            "open", "close", "read", "write", "pipe", "fsync", "ftruncate", "lseek", "rename", "unlink", "mkdir",
            "makedirs", "listdir", "stat", "fstat", "isatty", "readlink",
        ):  # fmt: skip
            setattr(fake_os, name, getattr(self, name))
        fake_os.replace, fake_os.remove, fake_os.fdatasync = self.rename, self.unlink, self.fsync
        fake_os.lstat, fake_os.dup = self.stat, self.copy
        fake_os.set_blocking = lambda fd, flag: None if self.ours(fd) else os.set_blocking(fd, flag)
        fake_os.truncate = self._truncate
        fake_os.path = SimpleNamespace(**vars(os.path))
        fake_os.path.exists = fake_os.path.lexists = self.exists
        fake_os.path.realpath = lambda path, **_: path if self.is_ours(os.fspath(path)) else os.path.realpath(path)
        fake_os.path.getsize = lambda path: self.stat(path).st_size
        fake_termios = SimpleNamespace(**vars(termios))
        fake_termios.tcgetattr, fake_termios.tcsetattr = self.tcgetattr, self.tcsetattr
        fake_termios.tcflow = lambda fd, action: self._tty_call("tcflow", fd).flow(goes=action == termios.TCOON)
        fake_termios.tcflush, fake_termios.tcdrain = self.tcflush, lambda fd: self._tty_call("tcdrain", fd) and None
        fake_select = SimpleNamespace(**vars(select))
        fake_select.select, fake_select.poll = self.select, lambda: Poll(self)
        fake_fcntl = SimpleNamespace(**vars(fcntl))
        fake_fcntl.fcntl, fake_fcntl.ioctl, fake_fcntl.flock = lambda *_: 0, self.ioctl, self.flock
        return {"os": fake_os, "fcntl": fake_fcntl, "termios": fake_termios, "select": fake_select}
