"""The client side of the control socket: an answer, a refusal, or the reason for neither."""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import pytest

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from tests.service.control_bench import SOON_S, closing_all, connected


def test_a_service_that_ends_in_mid_answer_is_told_as_such(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen()

        def hang_up() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(100)

        dying = Thread(target=hang_up)
        dying.start()
        with pytest.raises(ServiceError, match="no service answers on"):
            ask(path, {})
        dying.join()


@contextmanager
def impostor(path: Path, serve: Callable[[socket.socket], object]) -> Iterator[None]:
    """Another program answering there."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen(1)

        def run() -> None:
            connection, _ = listener.accept()
            with connection, suppress(OSError):
                serve(connection)

        serving = Thread(target=run)
        serving.start()
        yield
        serving.join()


def drip(connection: socket.socket) -> None:
    while True:
        connection.sendall(b" ")
        Event().wait(0.02)


def say_nothing(connection: socket.socket) -> None:
    connection.recv(100)
    connection.recv(1)


@pytest.mark.parametrize("serve", [drip, say_nothing])
def test_who_asks_waits_so_long_and_no_longer(tmp_path: Path, serve: Callable[[socket.socket], object]) -> None:
    path = tmp_path / "control.sock"
    with impostor(path, serve):
        began_s = time.monotonic()
        with pytest.raises(ServiceError, match=r"no service answers on .*timed out"):
            ask(path, {}, timeout_s=0.3)
        assert 0.25 < time.monotonic() - began_s < 0.3 + SOON_S


@pytest.mark.parametrize("line", [b"nonsense\n", b"[]\n", b'{"ok": false}\n', b"1\n"])
def test_what_is_no_service_is_told_as_such(tmp_path: Path, line: bytes) -> None:
    path = tmp_path / "control.sock"
    with (
        impostor(path, lambda connection: connection.recv(100) and connection.send(line)),
        pytest.raises(ServiceError, match=r"no service|refused"),
    ):
        ask(path, {})


def test_who_asks_gets_through_when_too_many_wait(tmp_path: Path) -> None:
    """The kernel's queue is full, then has room after a while."""
    path = tmp_path / "control.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener, closing_all() as clients:
        listener.bind(str(path))
        listener.listen(0)
        clients.append(connected(path))
        with pytest.raises(ServiceError, match="timed out"):
            ask(path, {}, timeout_s=0.1)

        def serve() -> None:
            Event().wait(0.3)
            clients.append(listener.accept()[0])
            connection, _ = listener.accept()
            with connection:
                connection.recv(100)
                connection.sendall(b'{"ok": true}\n')

        serving = Thread(target=serve)
        serving.start()
        assert ask(path, {})["ok"]
        serving.join()
