"""A socket's name in the file system: created for its owner or a group, watched, and removed only while it is ours."""

import os
import socket
from pathlib import Path

from orchestrator.errors import StartError
from orchestrator.model import Cause
from orchestrator.service.disk import code_of

#: The number of clients that may wait to be accepted; beyond that, connecting itself waits.
WAITING = 128
#: Connecting to a local socket takes no time, unless nobody accepts.
PROBE_S = 1.0

Identity = tuple[int, int]  #: device and inode


def listen(path: Path, group: int | None = None) -> socket.socket:
    """The listening socket, owner-only from the first moment, then also for a group; a dead one there is removed."""
    if not _is_free(path):
        raise StartError(Cause.of("socket_occupied", socket=str(path)))
    if is_alive(path):
        raise StartError(Cause.of("socket_answered", socket=str(path)))
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        _make_directory(path.parent, group)
        _bind(listener, path, group)
        listener.listen(WAITING)
    except OSError as error:
        listener.close()
        raise StartError(Cause.of("socket_failed", socket=str(path), error=code_of(error))) from None
    listener.settimeout(0)
    return listener


def _is_free(path: Path) -> bool:
    """Whether there is a socket or nothing; `bind` reports what we may not look at."""
    try:
        return path.is_socket() or not os.path.lexists(path)
    except OSError:
        return True


def _make_directory(directory: Path, group: int | None) -> None:
    """One for the owner; where a group must come through, others may do that and no more."""
    there = directory.exists()
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    if group is not None and not there:
        directory.chmod(0o711)


def _bind(listener: socket.socket, path: Path, group: int | None) -> None:
    path.unlink(missing_ok=True)
    os.fchmod(listener.fileno(), 0o600)  # Linux gives the name the socket's mode; the umask would affect all threads
    listener.bind(str(path))
    if group is not None:
        os.chown(path, -1, group, follow_symlinks=False)
        path.chmod(0o660)


def is_alive(path: Path) -> bool:
    """Whether somebody answers on a socket with this name; one that we may not connect to counts as well."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.settimeout(PROBE_S)
            probe.connect(str(path))
        except (BlockingIOError, TimeoutError):
            return True  # its queue of clients is full
        except PermissionError:
            return identity(path) is not None  # another user's; or we may not even look into the directory
        except OSError:
            return False
    return True


def identity(path: Path) -> Identity | None:
    """The file that has this name now; None if there is none, or if it is not visible to us."""
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


class SocketName:
    """A listening socket under its name, which somebody else may remove or take."""

    def __init__(self, path: Path, group: int | None = None) -> None:
        self._path, self._group, self.listener = path, group, listen(path, group)
        self._identity = identity(path)

    def look(self) -> Cause | None:
        """What has become of the name: None if nothing. If it was removed, there is a new `listener` under it."""
        found, socket_ = identity(self._path), str(self._path)
        if found == self._identity:
            return None
        if found is not None:
            return Cause.of("socket_taken", socket=socket_)
        try:
            self.listener = listen(self._path, self._group)
        except StartError as error:
            return Cause.of("socket_lost", socket=socket_, error=error.cause)
        self._identity = identity(self._path)
        return Cause.of("socket_again", socket=socket_)

    def remove(self) -> None:
        """Remove the name, unless it belongs to another socket by now."""
        if self._identity is not None and identity(self._path) == self._identity:
            self._path.unlink(missing_ok=True)
