"""One request to a running service over its control socket: one JSON object per line, out and in."""

import json
import pwd
import socket
import struct
from collections.abc import Mapping
from pathlib import Path
from time import monotonic

from orchestrator.errors import NoServiceError, ServiceError

#: More than any service sends.
MAX_ANSWER = 32 * 1024 * 1024


def ask(path: Path, request: Mapping[str, object], timeout_s: float = 5.0) -> dict[str, object]:
    """Send one request to a running service and return its answer, all within `timeout_s`.

    Raises NoServiceError if no service answers, ServiceError if the answer is no.
    """
    end_s = monotonic() + timeout_s
    try:
        answer = _exchange(path, request, end_s)
    except PermissionError:
        owners = _owners(path)
        raise NoServiceError(
            f"{path}: permission denied: only {' and '.join(owners)} may use it (sudo)",
            _cause("socket_forbidden", socket=str(path), owners=owners),
        ) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error) or "no answer"
        raise NoServiceError(
            f"no service answers on {path} ({reason}): is it running, and is this its control.socket? "
            "Name it with --socket or $ORCHESTRATOR_SOCKET",
            _cause("service_silent", socket=str(path), reason=reason),
        ) from None
    if not isinstance(answer, dict) or not answer.get("ok"):
        why = answer.get("error") if isinstance(answer, dict) else f"what answers on {path} is no service of this kind"
        told = answer.get("cause") if isinstance(answer, dict) else None
        raise ServiceError(str(why or "the service refused"), told)
    return answer


def _exchange(path: Path, request: Mapping[str, object], end_s: float) -> object:
    """The answer of whoever listens there. On a busy machine the service may hang up on a waiting client: ask again."""
    while True:
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
                _connect(client, path, max(end_s - monotonic(), 0.001))
                client.sendall(json.dumps(request).encode() + b"\n")
                return json.loads(_read_line(client, end_s))
        except (ConnectionResetError, BrokenPipeError):
            if request.get("verb") not in ("status", "stop", "pause") or monotonic() >= end_s:
                raise


def _connect(client: socket.socket, path: Path, timeout_s: float) -> None:
    """Connect; if too many clients are waiting already, queue in the kernel, which serves them in order."""
    whole_s, part_s = divmod(timeout_s, 1.0)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", int(whole_s), max(int(part_s * 1e6), 1)))
    try:
        client.connect(str(path))
    except BlockingIOError:
        raise TimeoutError("timed out") from None


def _read_line(client: socket.socket, end_s: float) -> bytes:
    """One line; the deadline covers all of it, even if the answer drips in byte by byte."""
    data = bytearray()
    while not data.endswith(b"\n"):
        client.settimeout(max(end_s - monotonic(), 0.001))
        part = client.recv(1 << 16)
        data += part
        if not part or len(data) > MAX_ANSWER or monotonic() > end_s:
            raise TimeoutError("timed out" if part else "no answer")
    return bytes(data)


def _cause(id_: str, **params: object) -> dict[str, object]:
    """A cause as a service would send it."""
    return {"id": id_, "params": params, "key": "", "place": "", "advice": ""}


def _owners(path: Path) -> list[str]:
    """Who may use the socket: its owner, or that of the closed directory which hides it, and root."""
    uid = next(place for place in (path, *path.parents) if _there(place)).stat().st_uid
    try:
        return list(dict.fromkeys((pwd.getpwuid(uid).pw_name, "root")))
    except KeyError:
        return [f"uid {uid}", "root"]


def _there(path: Path) -> bool:
    try:
        path.stat()
    except OSError:  # not there, or in a closed directory
        return False
    return True
