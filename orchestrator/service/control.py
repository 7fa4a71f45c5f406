"""The control socket: who may ask, how, and what is answered. One JSON object a line, in and out.

Only the owner of the service (and root) can open the socket, a request is bounded in size and time, and clients are
served one after another, so that no number of them can hold the bays up: the control loop never waits for a client.
"""

import errno
import json
import os
import socket
import struct
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from math import inf
from pathlib import Path
from time import sleep

from orchestrator.errors import OrchestratorError, ServiceError

#: The longest request, and how long a client may take to send one, and then to take its answer.
MAX_REQUEST = 4096
CLIENT_S = 1.0
#: So many clients may wait for their turn; one more is turned away by the kernel.
WAITING = 128
#: Reading, asking every bay and answering take at most this; longer means that the thread hangs.
STALL_S = 30.0
#: What accept() says of a listener that was closed; after anything else it is worth another try, a little later.
CLOSED = (errno.EINVAL, errno.EBADF)
RETRY_S = 0.1
#: After each client, so that no number of them takes more of the processor than fifty a second can.
PAUSE_S = 0.02
#: Strangers are counted, and said this often at most.
SAY_S = 60.0

Answer = Mapping[str, object]
Handler = Callable[[Mapping[str, object]], Answer]


class ControlSocket:
    """Listens on a Unix socket and answers each request with `handler`; its OrchestratorErrors become answers, too."""

    def __init__(
        self, path: Path, handler: Handler, clock: Callable[[], float], say: Callable[[str], None] = lambda _: None
    ) -> None:
        self._path, self._handler, self._clock, self._say = path, handler, clock, say
        self._strangers, self._said_s = 0, -inf  # turned away since that was said last
        self._client_s: float | None = None  # since when a client is being served
        self._listener = _listen(path)
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stalled(self, now_s: float) -> bool:
        """True when nobody answers any more, or one client has been served for far too long."""
        began_s = self._client_s
        return not self._thread.is_alive() or (began_s is not None and now_s - began_s > STALL_S)

    def close(self) -> None:
        """Stop listening and take the socket's name away."""
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._path.unlink(missing_ok=True)

    def _run(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError as error:
                if error.errno in CLOSED:
                    return
                sleep(RETRY_S)  # this client has left already, or there are too many open files
                continue
            self._client_s = self._clock()
            with client, suppress(OSError):
                answer = _line(self._answer(client))
                client.settimeout(CLIENT_S)
                client.sendall(answer)
            self._client_s = None
            sleep(PAUSE_S)

    def _answer(self, client: socket.socket) -> Answer:
        try:
            self._check_peer(client)
            line = _read_line(client, self._clock)
            return {"ok": True, **self._handler(parse_request(line))}
        except OrchestratorError as error:
            return {"ok": False, "error": str(error)}
        except Exception as error:  # noqa: BLE001 - a request must never end the thread that answers them
            return {"ok": False, "error": f"internal: {error!r}"}

    def _check_peer(self, client: socket.socket) -> None:
        pid, uid, _ = peer(client)
        if uid in (0, os.getuid()):
            return
        self._strangers += 1
        now_s = self._clock()
        if now_s - self._said_s >= SAY_S:
            self._say(f"control socket: turned user {uid} away (process {pid}; {self._strangers} since last said)")
            self._strangers, self._said_s = 0, now_s
        raise ServiceError("only the owner of the service may use this socket")


def peer(client: socket.socket) -> tuple[int, int, int]:
    """Process, user and group at the other end."""
    pid, uid, gid = struct.unpack("3i", client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
    return pid, uid, gid


def parse_request(line: bytes) -> Mapping[str, object]:
    """A request's object; ServiceError for anything else."""
    try:
        request = json.loads(line)
    except (ValueError, RecursionError):
        raise ServiceError("a request is one JSON object on one line") from None
    if not isinstance(request, dict):
        raise ServiceError("a request is one JSON object on one line")
    return request


def _read_line(client: socket.socket, clock: Callable[[], float]) -> bytes:
    """One line; its time is up for the whole of it, so that nobody holds the others up by sending byte for byte."""
    data, end_s = b"", clock() + CLIENT_S
    while b"\n" not in data:
        client.settimeout(max(end_s - clock(), 0.001))
        part = client.recv(MAX_REQUEST)
        data += part
        if len(data) > MAX_REQUEST or not part:
            raise ServiceError(f"a request is one line of at most {MAX_REQUEST} bytes")
    return data


def _listen(path: Path) -> socket.socket:
    """The listening socket, owner-only from the first moment on; a dead one in its place is removed."""
    if path.exists() and not path.is_socket():
        raise ServiceError(f"{path} is there already and is no socket: give this station another control.socket")
    if is_alive(path):
        raise ServiceError(
            f"another service answers on {path}: stop it first, or give this station another control.socket"
        )
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        _bind(listener, path)
    except OSError as error:
        listener.close()
        raise ServiceError(f"the control socket {path} cannot be opened: {error.strerror or error}") from None
    listener.listen(WAITING)
    return listener


def _bind(listener: socket.socket, path: Path) -> None:
    mask = os.umask(0o177)
    try:
        path.unlink(missing_ok=True)
        listener.bind(str(path))
    finally:
        os.umask(mask)


def is_alive(path: Path) -> bool:
    """Whether somebody answers on a socket of this name."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.settimeout(CLIENT_S)
            probe.connect(str(path))
        except (BlockingIOError, TimeoutError):
            return True  # there are more clients than it has answered yet
        except OSError:
            return False
    return True


def _line(answer: Answer) -> bytes:
    return json.dumps(answer, ensure_ascii=False).encode() + b"\n"


def ask(path: Path, request: Mapping[str, object], timeout_s: float = 5.0) -> dict[str, object]:
    """Send one request to a running service and return its answer.

    Raises ServiceError where no service answers, or where the answer is no.
    """
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
            client.settimeout(timeout_s)
            client.connect(str(path))
            client.sendall(_line(request))
            with client.makefile("rb") as stream:
                answer = json.loads(stream.readline())
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error) or "no answer"
        raise ServiceError(
            f"no service answers on {path} ({reason}): is it running, and is this its control.socket? "
            "Name it with --socket or $ORCHESTRATOR_SOCKET"
        ) from None
    if not answer.get("ok"):
        raise ServiceError(str(answer.get("error", "the service refused")))
    return dict(answer)
