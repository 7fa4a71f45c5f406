"""One client of the control socket: its incoming request and its outgoing answer. Nothing here ever blocks."""

import json
import socket
import struct
from array import array
from collections.abc import Mapping
from fcntl import ioctl
from termios import TIOCOUTQ

from orchestrator.errors import RequestError
from orchestrator.model import Cause

#: The longest request.
MAX_REQUEST = 4096
#: How long a client may take for its whole request, and then for its whole answer.
CLIENT_S = 1.0
#: The kernel's buffer for one answer: a client that does not read costs no more.
BUFFER = 64 * 1024


class Client:
    """An accepted connection. Belongs to the control thread."""

    def __init__(self, connection: socket.socket, now_s: float) -> None:
        connection.settimeout(0)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
        self.uid = -1  #: the user at the other end, once `peer` was called
        self.line = b""  #: its request, once complete
        self.request: Mapping[str, object] = {}
        self.heard_s = now_s  #: when the last byte of its request arrived
        self.end_s = now_s + CLIENT_S  #: when its time is up, whatever it is doing
        self.answering = False
        self._connection = connection
        self._heard = bytearray()
        self._left = memoryview(b"")

    def fileno(self) -> int:
        """The descriptor for a selector."""
        return self._connection.fileno()

    def peer(self) -> tuple[int, int, int]:
        """The process, user and group at the other end."""
        pid, self.uid, gid = struct.unpack("3i", self._connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
        return pid, self.uid, gid

    def hear(self, now_s: float) -> bool:
        """Take what has come; whether the request is complete. RequestError where it cannot become one any more."""
        try:
            part = self._connection.recv(MAX_REQUEST + 1 - len(self._heard))
        except BlockingIOError:
            return False
        self._heard += part
        self.heard_s = now_s
        if not part or len(self._heard) > MAX_REQUEST:
            raise RequestError(Cause.of("request_too_long", limit=MAX_REQUEST))
        if b"\n" in part:
            self.line = bytes(self._heard)  # anything after the line makes it an invalid request
        return bool(self.line)

    def answer(self, text: bytes, now_s: float) -> None:
        """Start writing this answer; `text` may be shared with other clients."""
        self._left, self.answering, self.end_s = memoryview(text), True, now_s + CLIENT_S

    def write(self) -> bool:
        """Write as much as possible without blocking; returns whether that was all. OSError if the client has left."""
        try:
            self._left = self._left[self._connection.send(self._left) :]
        except BlockingIOError:
            return False
        return not self._left

    @property
    def left(self) -> int:
        """The number of bytes that are still to be written."""
        return len(self._left)

    @property
    def waiting(self) -> int:
        """About how many bytes the client has not taken yet, those in the kernel's buffer included; 0 means none."""
        held = array("i", [0])
        ioctl(self, TIOCOUTQ, held)
        return held[0] + self.left

    def has_left(self) -> bool:
        """Whether the client has closed its end; what it says is not heard. OSError if the connection is broken."""
        try:
            return not self._connection.recv(MAX_REQUEST)
        except BlockingIOError:
            return False

    def close(self) -> None:
        """Close the connection."""
        self._left.release()
        self._connection.close()


def parse_request(line: bytes) -> Mapping[str, object]:
    """A request's object; RequestError for anything else."""
    try:
        request = json.loads(line)
    except (ValueError, RecursionError):
        raise RequestError(Cause("request_no_object")) from None
    if not isinstance(request, dict):
        raise RequestError(Cause("request_no_object"))
    return request
