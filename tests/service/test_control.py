"""The control socket with real clients: good ones, slow ones, rude ones, too many of them."""

import json
import os
import resource
import socket
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.errors import ServiceError
from orchestrator.service import control as control_module
from orchestrator.service.control import (
    CLIENT_S,
    MAX_REQUEST,
    PAUSE_S,
    RETRY_S,
    SAY_S,
    STALL_S,
    ControlSocket,
    ask,
    is_alive,
    parse_request,
)
from tests.waiting import wait_until


def answer(request: Mapping[str, object]) -> Mapping[str, object]:
    """Says what it heard; refuses and breaks when asked to."""
    if request.get("verb") == "refuse":
        raise ServiceError("not today")
    if request.get("verb") == "break":
        raise KeyError("lost")
    return {"heard": dict(request)}


@contextmanager
def listening(path: Path) -> Iterator[ControlSocket]:
    control = ControlSocket(path, answer, time.monotonic)
    control.start()
    try:
        yield control
    finally:
        control.close()


@pytest.fixture(name="path")
def _path(tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "run" / "control.sock"
    with listening(path):
        yield path


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


def test_a_request_is_answered(path: Path) -> None:
    assert ask(path, {"verb": "status", "bay": None}) == {"ok": True, "heard": {"verb": "status", "bay": None}}


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
    with pytest.raises(ServiceError, match=r"another service answers on .*: stop it first"):
        ControlSocket(path, answer, time.monotonic)
    assert ask(path, {})["ok"]


def test_a_service_that_is_behind_with_its_answers_is_alive(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hanging, closing_all() as clients:
        hanging.bind(str(path))
        hanging.listen(1)
        with suppress(BlockingIOError):
            while True:  # fill what it lets wait
                waiting = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
                clients.append(waiting)
                waiting.setblocking(False)
                waiting.connect(str(path))
        with pytest.raises(ServiceError, match="another service answers"):
            ControlSocket(path, answer, time.monotonic)
    assert path.exists()


@contextmanager
def closing_all() -> Iterator[list[socket.socket]]:
    clients: list[socket.socket] = []
    try:
        yield clients
    finally:
        for one in clients:
            one.close()


def test_no_file_of_a_person_is_removed(tmp_path: Path) -> None:
    mine = tmp_path / "station.yaml"
    mine.write_text("station: x", encoding="utf-8")
    with pytest.raises(ServiceError, match="is no socket"):
        ControlSocket(mine, answer, time.monotonic)
    assert mine.read_text(encoding="utf-8") == "station: x"


@pytest.mark.parametrize("name", ["file/control.sock", "x" * 200])
def test_a_place_that_cannot_be_is_one_sentence(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ServiceError, match=r"the control socket .* cannot be opened: "):
        ControlSocket(tmp_path / name, answer, time.monotonic)


def test_its_name_goes_with_it(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    with listening(path):
        assert path.exists()
    assert not path.exists()
    with pytest.raises(ServiceError, match=r"no service answers on .* \(No such file or directory\): is it running"):
        ask(path, {})


@pytest.mark.parametrize(
    "line",
    [b"\n", b"status\n", b"[]\n", b'"status"\n', b"\xff\xfe\n", b"{\n", b"[" * 4000 + b"\n", b"\0" * 100 + b"\n"],
)
def test_what_is_no_request_is_told_so(path: Path, line: bytes) -> None:
    with client(path) as connection:
        connection.sendall(line)
        assert reply(connection) == {"ok": False, "error": "a request is one JSON object on one line"}
    assert ask(path, {})["ok"]


def test_a_request_without_end_is_cut_off(path: Path) -> None:
    with client(path) as connection, suppress(BrokenPipeError, ConnectionResetError):
        connection.sendall(b"x" * (MAX_REQUEST + 1))
        assert reply(connection)["error"] == f"a request is one line of at most {MAX_REQUEST} bytes"
    assert ask(path, {})["ok"]


def test_half_a_request_is_none(path: Path) -> None:
    with client(path) as connection:
        connection.sendall(b'{"verb": "stop"')
        connection.shutdown(socket.SHUT_WR)
        assert reply(connection)["ok"] is False


def test_one_who_leaves_at_once_harms_nobody(path: Path) -> None:
    for _ in range(20):
        with client(path):
            pass
    with client(path) as connection:
        connection.sendall(b"{}\n")  # and does not wait for the answer
    assert ask(path, {})["ok"]


def test_one_who_says_nothing_holds_the_others_up_for_its_time_only(path: Path) -> None:
    with client(path):
        began_s = time.monotonic()
        assert ask(path, {})["ok"]
        assert time.monotonic() - began_s < CLIENT_S + 0.5


def test_one_who_sends_byte_by_byte_gets_no_more_time(path: Path) -> None:
    pause = Event()
    with client(path) as connection:

        def drip() -> None:
            with suppress(OSError):
                while True:
                    connection.sendall(b" ")
                    pause.wait(CLIENT_S / 20)

        dripping = Thread(target=drip)
        dripping.start()
        began_s = time.monotonic()
        assert ask(path, {})["ok"]
        assert time.monotonic() - began_s < CLIENT_S + 0.5
        connection.shutdown(socket.SHUT_RDWR)
        dripping.join()


def test_a_crowd_is_served_one_after_another(path: Path) -> None:
    heard: list[object] = []
    crowd = [
        Thread(target=lambda number=number: heard.append(ask(path, {"n": number})["heard"])) for number in range(8)
    ]
    for one in crowd:
        one.start()
    for one in crowd:
        one.join()
    assert sorted(map(str, heard)) == [str({"n": number}) for number in range(8)]


def test_an_answer_that_nobody_takes_ends(tmp_path: Path) -> None:
    """More than the kernel buffers, to a client that does not read."""
    path = tmp_path / "control.sock"
    control = ControlSocket(path, lambda _: {"much": "x" * 5_000_000}, time.monotonic)
    control.start()
    try:
        with client(path) as connection:
            connection.sendall(b"{}\n")
            assert len(str(ask(path, {}, timeout_s=10)["much"])) == 5_000_000
    finally:
        control.close()


def test_a_handler_that_hangs_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "control.sock"
    with listening(path) as control:
        assert not control.stalled(time.monotonic() + 100 * STALL_S)
        with client(path):
            wait_until(lambda: control.stalled(time.monotonic() + STALL_S), what="a client in hand")
            assert not control.stalled(time.monotonic())
    wait_until(lambda: control.stalled(time.monotonic()), what="the end of its thread")


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


@given(st.binary(max_size=200))
def test_any_bytes_are_a_request_or_refused(line: bytes) -> None:
    with suppress(ServiceError):
        assert isinstance(parse_request(line), dict)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@given(st.dictionaries(st.text(max_size=5), json_values, max_size=4))
def test_every_object_is_a_request(request: dict[str, object]) -> None:
    assert parse_request(json.dumps(request).encode()) == request


@given(json_values.filter(lambda value: not isinstance(value, dict)))
def test_everything_else_is_not(value: object) -> None:
    with pytest.raises(ServiceError):
        parse_request(json.dumps(value).encode())


def test_too_many_open_files_are_no_end(tmp_path: Path) -> None:
    """accept() fails as soon as it is called; when there is room again, whoever has come meanwhile is answered."""
    control = ControlSocket(tmp_path / "control.sock", answer, time.monotonic)
    with client(tmp_path / "control.sock") as early, taken_files():
        control.start()
        early.sendall(b'{"verb": "status"}\n')
        early.settimeout(3 * RETRY_S)
        with pytest.raises(TimeoutError):
            early.recv(1)
        assert not control.stalled(time.monotonic())
    with client(tmp_path / "control.sock") as late:
        late.sendall(b'{"verb": "status"}\n')
        assert reply(late)["ok"] is True
    control.close()


@contextmanager
def taken_files() -> Iterator[None]:
    """No file can be opened any more, in the whole process."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    files: list[int] = []
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(soft, 256), hard))
        with suppress(OSError):
            while True:
                files.append(os.dup(0))
        yield
    finally:
        for file in files:
            os.close(file)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_a_stranger_is_turned_away_and_that_is_said_once_a_minute(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    now_s = [1000.0]
    path = tmp_path / "control.sock"
    control = ControlSocket(path, answer, lambda: now_s[0], said.append)
    control.start()
    try:
        monkeypatch.setattr(control_module, "peer", lambda _: (4711, 12345, 12345))
        for _ in range(3):
            with pytest.raises(ServiceError):
                ask(path, {})
        assert said == ["control socket: turned user 12345 away (process 4711; 1 since last said)"]
        now_s[0] += SAY_S
        with pytest.raises(ServiceError):
            ask(path, {})
        assert said[1:] == ["control socket: turned user 12345 away (process 4711; 3 since last said)"]
    finally:
        control.close()


def test_a_flood_is_served_at_its_pace(path: Path) -> None:
    began_s = time.monotonic()
    for _ in range(20):
        ask(path, {})
    assert time.monotonic() - began_s > 19 * PAUSE_S
