"""The control socket's name in the file system: made owner-only, watched, and taken away only while it is ours."""

import os
import socket
from pathlib import Path

from orchestrator.errors import StartError
from orchestrator.model import Cause
from orchestrator.service.disk import code_of

#: So many clients may wait for their turn; after that, connecting itself waits.
WAITING = 128
#: Connecting to a socket on this machine takes no time, unless nobody takes the connections.
PROBE_S = 1.0

Identity = tuple[int, int]  #: device and inode


def listen(path: Path) -> socket.socket:
    """The listening socket, owner-only from the first moment on; a dead one in its place is removed."""
    if not _is_free(path):
        raise StartError(Cause.of("socket_occupied", socket=str(path)))
    if is_alive(path):
        raise StartError(Cause.of("socket_answered", socket=str(path)))
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        _bind(listener, path)
        listener.listen(WAITING)
    except OSError as error:
        listener.close()
        raise StartError(Cause.of("socket_failed", socket=str(path), error=code_of(error))) from None
    listener.settimeout(0)
    return listener


def _is_free(path: Path) -> bool:
    """Whether there is a socket or nothing; what we may not look at is said by `bind`."""
    try:
        return path.is_socket() or not os.path.lexists(path)
    except OSError:
        return True


def _bind(listener: socket.socket, path: Path) -> None:
    path.unlink(missing_ok=True)
    os.fchmod(listener.fileno(), 0o600)  # Linux gives the name the mode that the socket has; the umask is all threads'
    listener.bind(str(path))


def is_alive(path: Path) -> bool:
    """Whether somebody answers on a socket of this name; one that we may not ask counts as well."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.settimeout(PROBE_S)
            probe.connect(str(path))
        except (BlockingIOError, TimeoutError):
            return True  # there are more clients than it has answered yet
        except PermissionError:
            return identity(path) is not None  # another user's; or we may not even look into the folder
        except OSError:
            return False
    return True


def identity(path: Path) -> Identity | None:
    """Which file has this name now; None if none has, or if that cannot be told."""
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def remove(path: Path, ours: Identity | None) -> None:
    """Take the name away, unless it is another's by now."""
    if ours is not None and identity(path) == ours:
        path.unlink(missing_ok=True)
