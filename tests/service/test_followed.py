"""Following the status of a service over one connection: what is told is put together, and an end is an error."""

import argparse
import json
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from orchestrator.errors import ServiceError
from orchestrator.service import followed as followed_module
from orchestrator.service import watch as watch_module
from orchestrator.service.followed import Followed, Refused
from tests.service.control_bench import listening

BAYS = [{"name": name, "state": "IDLE"} for name in "ab"]
DOCUMENT: dict[str, Any] = {"station": "hall", "alarm": "none", "bays": BAYS}
FIRST = {"ok": True, "revision": 7, "instance": "x", "document": DOCUMENT}


@contextmanager
def service(path: Path, answers: Callable[[socket.socket], None]) -> Iterator[None]:
    """Takes one client."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()

        def serve() -> None:
            connection, _ = listener.accept()
            with connection, connection.makefile("rb") as stream:
                assert json.loads(stream.readline()) == {"verb": "watch", "version": 1}
                answers(connection)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield
        thread.join(5)


def line(said: object) -> bytes:
    return json.dumps(said).encode() + b"\n"


def test_what_changes_is_put_together(tmp_path: Path) -> None:
    changes = line(
        {
            "revision": 8,
            "time": 2.0,
            "bays": {"b": {"name": "b", "state": "TRIPPED"}},
            "station": {"alarm": "attention"},
        }
    )

    def answers(connection: socket.socket) -> None:
        connection.sendall(line(FIRST) + changes[:20])
        connection.sendall(changes[20:] + line({"revision": 9, "time": 3.0, "gone": ["a"]}))

    with service(tmp_path / "s", answers):
        one = Followed(tmp_path / "s", 5.0)
        with pytest.raises(ConnectionError):
            one.wait(5.0, 5.0)
        assert one.document == {
            "time": 3.0,
            "station": "hall",
            "alarm": "attention",
            "bays": [{"name": "b", "state": "TRIPPED"}],
        }
        one.close()


def test_it_waits_shorter_if_something_has_changed(tmp_path: Path) -> None:
    go_on = threading.Event()

    def answers(connection: socket.socket) -> None:
        connection.sendall(line(FIRST))
        go_on.wait(5)
        connection.sendall(line({"revision": 8, "time": 2.0, "bays": {"a": {"name": "a", "state": "HELD"}}}))
        connection.recv(1)

    with service(tmp_path / "s", answers):
        one = Followed(tmp_path / "s", 5.0)
        began_s = monotonic()
        one.wait(0.0, 0.05)
        assert monotonic() - began_s >= 0.05
        go_on.set()
        one.wait(0.0, 20.0)
        assert monotonic() - began_s < 10
        assert one.document["bays"][0]["state"] == "HELD"
        one.close()


def test_one_that_refuses_and_one_that_says_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def listens(connection: socket.socket) -> None:
        connection.recv(1)

    older = line({"ok": False, "error": "unknown verb"})
    with service(tmp_path / "old", lambda connection: connection.sendall(older)), pytest.raises(Refused):
        Followed(tmp_path / "old", 5.0)
    with service(tmp_path / "mute", listens), pytest.raises(TimeoutError):
        Followed(tmp_path / "mute", 0.05)
    with pytest.raises(FileNotFoundError):
        Followed(tmp_path / "nobody", 0.05)
    monkeypatch.setattr(followed_module, "SILENT_S", 0.01)

    def stops(connection: socket.socket) -> None:
        connection.sendall(line(FIRST))
        connection.recv(1)

    with service(tmp_path / "hung", stops):
        one = Followed(tmp_path / "hung", 5.0)
        with pytest.raises(TimeoutError):
            one.wait(0.05, 0.05)
        one.close()


ARGUMENTS = argparse.Namespace(bay=["a"], excepted=[], problems=False, json=False, group=False)


def test_who_watches_follows_and_asks_where_he_cannot(tmp_path: Path) -> None:
    def answers(connection: socket.socket) -> None:
        connection.sendall(line(FIRST))

    with service(tmp_path / "s", answers):
        source = watch_module._Source(tmp_path / "s", ARGUMENTS)
        assert source.look() == {**DOCUMENT, "bays": DOCUMENT["bays"][:1]}
        source.wait()  # which sees the end
    with pytest.raises(ServiceError, match="no service answers"):
        source.look()
    with listening(tmp_path / "old", lambda request: {**DOCUMENT, "asked": request["verb"]}):
        older = watch_module._Source(tmp_path / "old", ARGUMENTS)
        assert older.look()["asked"] == "status"
