"""Which service is asked when none is named."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from pwd import getpwuid

import pytest

from orchestrator.cli import main
from orchestrator.errors import NoSocketError, ServiceError, StartError
from orchestrator.lastresort.asking import ask
from orchestrator.service.control import ControlSocket
from orchestrator.service.unreachable import unreachable
from orchestrator.service.where import find_socket
from tests.core.said import raises, say

#: Who may use a socket of ours.
OWNERS = dict.fromkeys((getpwuid(os.geteuid()).pw_name, "root"))


@pytest.fixture(name="folder")
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("ORCHESTRATOR_SOCKET", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(folder: Path, named: str | None = None) -> str:
    return str(find_socket(named, installed=folder / "installed.sock"))


def test_the_nearest_wins(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with raises(
        NoSocketError, rf"no service found: .* no {folder}/station\.yaml .* no {folder}/installed\.sock; .*--socket"
    ):
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
    assert f"closed/control.sock: permission denied: only {' and '.join(OWNERS)} may use it" in said


def test_a_service_that_may_not_make_its_socket_says_so(folder: Path) -> None:
    said = as_nobody(folder, lambda socket: ControlSocket(socket, lambda _: {}, lambda: 0.0))
    assert "control.sock cannot be opened: Permission denied" in said


#: What `unreachable` needs to know of a refusal by the kernel.
FORBIDDEN = {"id": "socket_forbidden", "params": {"socket": "/run/x.sock", "owners": ["kim", "root"]}}


@pytest.mark.parametrize(
    ("program", "words", "typed"),
    [
        ("/usr/bin/orchestrator", ["stop", "bay 1"], "sudo orchestrator stop 'bay 1' --socket /run/x.sock"),
        ("/opt/o/bin/orchestrator", ["status"], "sudo /opt/o/bin/orchestrator status --socket /run/x.sock"),
        ("/x/__main__.py", ["status", "--socket=/y"], f"sudo {sys.executable} -m orchestrator status --socket=/y"),
    ],
)
def test_what_to_type_is_the_same_command_for_sudo(
    monkeypatch: pytest.MonkeyPatch, program: str, words: list[str], typed: str
) -> None:
    monkeypatch.setattr(sys, "argv", [program])
    said = say(unreachable(FORBIDDEN, None, words))
    assert said == f"/run/x.sock: permission denied: only kim and root may use it; type: {typed}"


def test_a_service_that_does_not_answer_is_told_with_what_named_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    (folder / "station.yaml").write_text("control: {socket: run/mine.sock}\n", encoding="utf-8")
    assert main(["stop", "--all"]) == 2
    assert capsys.readouterr().err == (
        f"orchestrator: no service answers on run/mine.sock (No such file or directory), the socket named by "
        f"{folder}/station.yaml: is it running? To stop chargers without a service: orchestrator estop\n"
    )
    (folder / "installed.sock").touch()
    monkeypatch.setattr("orchestrator.service.unreachable.INSTALLED", folder / "installed.sock")
    monkeypatch.setenv("ORCHESTRATOR_SOCKET", "/from/environment")
    assert main(["status"]) == 2
    said = capsys.readouterr().err
    assert "named by $ORCHESTRATOR_SOCKET: is it running?" in said
    assert f"The installed service has another one: --socket {folder}/installed.sock" in said
    monkeypatch.setenv("LC_ALL", "ko_KR.UTF-8")
    assert main(["start", "--all", "--socket", "x"]) == 2
    assert "응답하는 서비스가 없습니다" in capsys.readouterr().err


def test_what_is_no_such_answer_is_none() -> None:
    for told in (None, "x", {}, {"id": "bay_unknown", "params": {}}, {"id": "socket_forbidden"}):
        assert unreachable(told, None, []) is None
