"""Which service is asked, when nobody says which."""

import os
from pathlib import Path

import pytest

from orchestrator.errors import ServiceError, UsageError
from orchestrator.service.control import ask
from orchestrator.service.where import find_socket


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


def test_who_may_not_use_it_is_told_who_may(folder: Path) -> None:
    """As another user than root, who may everything: in a process of its own."""
    (folder / "closed").mkdir(mode=0o700)
    child = os.fork()
    if child == 0:
        try:
            if os.getuid() == 0:
                os.chmod(folder, 0o711)  # noqa: PTH101 - no more may be imported here
                os.setuid(65534)
            else:
                (folder / "closed").chmod(0)
            socket = find_socket(None, Path("none"), folder / "closed" / "control.sock")
            ask(socket, {"verb": "status"})
        except ServiceError as error:
            says_so = "permission denied: only " in str(error) and "root may use it" in str(error)
            os._exit(0 if says_so else 1)
        finally:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
