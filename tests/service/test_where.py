"""Which service is asked when none is named."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestrator.errors import ServiceError, StartError, UsageError
from orchestrator.lastresort.asking import ask
from orchestrator.service.control import ControlSocket
from orchestrator.service.where import find_socket
from tests.core.said import say


@pytest.fixture(name="folder")
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("ORCHESTRATOR_SOCKET", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(folder: Path, named: str | None = None) -> str:
    return str(find_socket(named, installed=folder / "installed.sock"))


def test_the_nearest_wins(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match=r"no service found: .* no station\.yaml .* --socket PATH"):
        found(folder)
    (folder / "installed.sock").touch()
    assert found(folder) == str(folder / "installed.sock")
    (folder / "station.yaml").write_text("control: {socket: run/mine.sock}\n  broken: [", encoding="utf-8")
    assert found(folder) == "run/mine.sock"
    monkeypatch.setenv("ORCHESTRATOR_SOCKET", "/from/environment")
    assert found(folder) == "/from/environment"
    assert found(folder, "/named") == "/named"


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\0", b"station: x\n", b"control: 5\n"])
def test_a_station_file_that_names_none_is_passed_over(folder: Path, content: bytes) -> None:
    (folder / "station.yaml").write_bytes(content)
    (folder / "installed.sock").touch()
    assert found(folder) == str(folder / "installed.sock")


def as_nobody(folder: Path, do: Callable[[Path], object]) -> str:
    """The complaints when a user without access to the directory `closed` does it, in a separate process."""
    closed = folder / "closed"
    closed.mkdir(mode=0o700)
    folder.chmod(0o711)
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if os.getuid() == 0:
                os.setuid(65534)
            else:
                closed.chmod(0)
            do(closed / "control.sock")
        except ServiceError as error:
            os.write(writer, str(error).encode())
        except StartError as error:
            os.write(writer, say(error.cause).encode())
        finally:
            os._exit(0)
    os.close(writer)
    os.waitpid(child, 0)
    with os.fdopen(reader) as stream:
        return stream.read()


def test_who_may_not_use_it_is_told_who_may(folder: Path) -> None:
    said = as_nobody(folder, lambda socket: ask(find_socket(None, Path("none"), socket), {"verb": "status"}))
    assert "closed/control.sock: permission denied: only " in said and "and root may use it" in said


def test_a_service_that_may_not_make_its_socket_says_so(folder: Path) -> None:
    said = as_nobody(folder, lambda socket: ControlSocket(socket, lambda _: {}, lambda: 0.0))
    assert "control.sock cannot be opened: Permission denied" in said
