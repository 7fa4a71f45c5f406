"""The client side of the control socket: an answer, a refusal, or the reason for neither."""

import os
import pwd
import socket
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import pytest

from orchestrator.errors import NoServiceError, ServiceError
from orchestrator.lastresort.asking import ask
from tests.link.strangers import somebody_else
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


@pytest.mark.parametrize(("verb", "goes_on"), [("status", True), ("stop", True), ("start", False)])
def test_who_is_hung_up_on_asks_again_if_that_does_no_harm(tmp_path: Path, verb: str, *, goes_on: bool) -> None:
    path = tmp_path / "control.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen()

        def serve() -> None:
            listener.accept()[0].close()  # with a request unread, so that the other end is reset
            if goes_on:
                connection, _ = listener.accept()
                with connection:
                    connection.recv(100)
                    connection.sendall(b'{"ok": true}\n')

        waiting = Thread(target=serve, daemon=True)
        waiting.start()
        if goes_on:
            assert ask(path, {"verb": verb})["ok"]
        else:
            with pytest.raises(ServiceError, match=r"Connection reset by peer|Broken pipe"):
                ask(path, {"verb": verb})
        waiting.join()


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("seen", [True, False])
def test_who_may_not_ask_is_told_who_may(monkeypatch: pytest.MonkeyPatch, *, seen: bool, named: bool) -> None:
    """By name if the machine has one, even where the folder does not let us look at the socket itself."""
    who = " and ".join(dict.fromkeys((pwd.getpwuid(os.geteuid()).pw_name, "root")))
    if not named:
        monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
        who = f"uid {os.geteuid()} and root"
    open_folder, closed_folder = (0o711, 0o700) if os.geteuid() == 0 else (0o700, 0)
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        path = Path(folder, "control.sock")
        listener.bind(str(path))
        listener.listen()
        path.chmod(0)
        Path(folder).chmod(open_folder if seen else closed_folder)
        with somebody_else(), pytest.raises(NoServiceError, match=f"permission denied: only {who} may use it"):
            ask(path, {})
        Path(folder).chmod(0o700)
