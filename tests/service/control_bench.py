"""A control socket with a test handler, and its clients."""

import json
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from threading import Event

from orchestrator.errors import RequestError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.service.client import CLIENT_S, Client
from orchestrator.service.control import ControlSocket
from orchestrator.service.reception import Answer, Handler, Later
from tests.core.said import cause


def answer(request: Mapping[str, object]) -> Mapping[str, object]:
    """Repeats the request; refuses or breaks when asked to."""
    if request.get("verb") == "refuse":
        raise RequestError(cause("not today"))
    if request.get("verb") == "break":
        raise KeyError("lost")
    return {"heard": dict(request)}


@contextmanager
def listening(
    path: Path, handler: Handler = answer, watch: Callable[[Client], Cause | None] | None = None
) -> Iterator[ControlSocket]:
    control = ControlSocket(path, handler, time.monotonic, watch=watch)
    control.start()
    try:
        yield control
    finally:
        control.close()


@contextmanager
def client(path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(5 * CLIENT_S)
        connection.connect(str(path))
        yield connection


def reply(connection: socket.socket) -> dict[str, object]:
    with connection.makefile("rb") as stream:
        said: dict[str, object] = json.loads(stream.readline())
    return said


@contextmanager
def closing_all() -> Iterator[list[socket.socket]]:
    clients: list[socket.socket] = []
    try:
        yield clients
    finally:
        for one in clients:
            one.close()


#: Far less than a client may take, and far more than an answer needs.
SOON_S = 0.4


def answered_soon(path: Path) -> None:
    began_s = time.monotonic()
    assert ask(path, {})["ok"]
    assert time.monotonic() - began_s < SOON_S


def connected(path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.connect(str(path))  # which waits in a queue
    connection.settimeout(5 * CLIENT_S)
    return connection


class Bays:
    """A handler that records requests and answers when released."""

    def __init__(self) -> None:
        self.asked: list[object] = []
        self.statuses = 0
        self.ready = Event()

    def __call__(self, request: Mapping[str, object]) -> Answer | Later:
        if request["verb"] == "status":
            self.statuses += 1
            return {"statuses": self.statuses}
        self.asked.append(request["verb"])
        return lambda: {"results": {}} if self.ready.is_set() else None
