"""The control socket in the file system: permissions, other files in its place, and its name."""

import os
import socket
import stat
import time
from contextlib import suppress
from pathlib import Path
from threading import Event

import pytest

from orchestrator.errors import ServiceError, StartError
from orchestrator.lastresort.asking import ask
from orchestrator.service import control as control_module
from orchestrator.service.control import ControlSocket
from orchestrator.service.socketfile import is_alive
from tests.core.said import into, raises
from tests.service.control_bench import answer, answered_soon, closing_all, listening
from tests.waiting import wait_until


def test_a_request_is_answered(path: Path) -> None:
    assert ask(path, {"verb": "status", "bay": None}) == {
        "ok": True,
        "heard": {"verb": "status", "bay": None, "uid": os.getuid()},
    }


def test_an_error_is_an_answer_too(path: Path) -> None:
    with pytest.raises(ServiceError, match=r"^not today$"):
        ask(path, {"verb": "refuse"})


def test_a_defect_ends_nothing(path: Path) -> None:
    with pytest.raises(ServiceError, match=r"internal: KeyError\('lost'\)"):
        ask(path, {"verb": "break"})
    assert ask(path, {})["ok"]


def test_only_the_owner_can_open_it(path: Path) -> None:
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


def test_the_mask_for_new_files_is_as_it_was(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        with listening(tmp_path / "control.sock"):
            assert os.umask(0o022) == 0o022
    finally:
        os.umask(before)


def test_a_dead_socket_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(str(path))
    assert not is_alive(path)
    with listening(path):
        assert ask(path, {})["ok"]


def test_a_second_service_is_refused_and_the_first_one_goes_on(path: Path) -> None:
    with raises(StartError, match=r"another service answers on .*: stop it first"):
        ControlSocket(path, answer, time.monotonic)
    assert ask(path, {})["ok"]


def test_a_service_that_is_behind_with_its_answers_is_alive(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hanging, closing_all() as clients:
        hanging.bind(str(path))
        hanging.listen(1)
        with suppress(BlockingIOError):
            while True:  # fill its backlog
                waiting = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
                clients.append(waiting)
                waiting.setblocking(False)
                waiting.connect(str(path))
        with raises(StartError, match="another service answers"):
            ControlSocket(path, answer, time.monotonic)
    assert path.exists()


def test_no_file_of_a_person_is_removed(tmp_path: Path) -> None:
    mine = tmp_path / "station.yaml"
    mine.write_text("station: x", encoding="utf-8")
    with raises(StartError, match="is no socket"):
        ControlSocket(mine, answer, time.monotonic)
    assert mine.read_text(encoding="utf-8") == "station: x"


@pytest.mark.parametrize("name", ["file/control.sock", "x" * 200])
def test_a_place_that_cannot_be_is_one_sentence(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").touch()
    with raises(StartError, match=r"the control socket .* cannot be opened: "):
        ControlSocket(tmp_path / name, answer, time.monotonic)


def test_its_name_goes_with_it(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    with listening(path):
        assert path.exists()
    assert not path.exists()
    with pytest.raises(ServiceError, match=r"no service answers on .* \(No such file or directory\): is it running"):
        ask(path, {})


def test_a_name_that_somebody_removes_comes_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_module, "NAME_S", 0.05)
    said: list[str] = []
    path = tmp_path / "control.sock"
    control = ControlSocket(path, answer, time.monotonic, into(said))
    control.start()
    try:
        path.unlink()
        wait_until(path.exists, what="the name")
        answered_soon(path)
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert said == [f"control socket: {path} was removed by somebody; it is there again"]
    finally:
        control.close()
    assert not path.exists()


def test_a_name_that_is_anothers_by_now_is_left_to_him_and_that_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(control_module, "NAME_S", 0.02)
    said: list[str] = []
    path = tmp_path / "control.sock"
    control = ControlSocket(path, answer, time.monotonic, into(said))
    control.start()
    try:
        (tmp_path / "other").touch()
        (tmp_path / "other").rename(path)
        wait_until(lambda: said, what="a word of it")
        Event().wait(0.1)
        assert said == [f"control socket: {path} is another program's by now: end that, or restart this service"]
    finally:
        control.close()
    assert path.exists()


def test_a_link_to_nowhere_in_its_place_is_left_to_its_owner(tmp_path: Path) -> None:
    (tmp_path / "control.sock").symlink_to(tmp_path / "nowhere")
    with raises(StartError, match="is no socket"):
        ControlSocket(tmp_path / "control.sock", answer, time.monotonic)
