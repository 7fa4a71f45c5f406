"""The control socket with real clients: good ones, slow ones, rude ones, too many of them."""

import json
import os
import resource
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.service import control as control_module
from orchestrator.service import reception as reception_module
from orchestrator.service.client import CLIENT_S, MAX_REQUEST, Client, parse_request
from orchestrator.service.control import (
    MAX_CLIENTS,
    REST_S,
    RETRY_S,
    SAY_S,
    STALL_S,
    ControlSocket,
)
from orchestrator.service.reception import PAUSE_S, SHARED_S, Answer, Handler, Later
from orchestrator.service.socketfile import is_alive
from tests.waiting import wait_until


def answer(request: Mapping[str, object]) -> Mapping[str, object]:
    """Says what it heard; refuses and breaks when asked to."""
    if request.get("verb") == "refuse":
        raise ServiceError("not today")
    if request.get("verb") == "break":
        raise KeyError("lost")
    return {"heard": dict(request)}


@contextmanager
def listening(path: Path, handler: Handler = answer) -> Iterator[ControlSocket]:
    control = ControlSocket(path, handler, time.monotonic)
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


#: Far less than a client may take, and far more than an answer takes.
SOON_S = 0.4


def answered_soon(path: Path) -> None:
    began_s = time.monotonic()
    assert ask(path, {})["ok"]
    assert time.monotonic() - began_s < SOON_S


def test_one_who_says_nothing_holds_nobody_up_and_is_sent_away(path: Path) -> None:
    with client(path) as silent:
        answered_soon(path)
        began_s = time.monotonic()
        assert silent.recv(1) == b""
        assert CLIENT_S / 2 < time.monotonic() - began_s < 2 * CLIENT_S


def test_one_who_sends_byte_by_byte_gets_no_more_time(path: Path) -> None:
    began_s, pause = time.monotonic(), Event()
    with client(path) as connection, suppress(OSError):
        while True:
            connection.sendall(b" ")
            answered_soon(path)
            pause.wait(CLIENT_S / 20)
    assert time.monotonic() - began_s < 2 * CLIENT_S


def test_idle_clients_do_not_count_however_many_they_are(path: Path) -> None:
    with closing_all() as idle:
        for _ in range(MAX_CLIENTS + 50):
            idle.append(connected(path))
        answered_soon(path)
        half = connected(path)
        idle.append(half)
        half.sendall(b"{")
        for _ in range(MAX_CLIENTS - 2):  # those who have been silent for longer go
            idle.append(connected(path))
        half.sendall(b"}\n")
        assert reply(half)["ok"] is True


def connected(path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.connect(str(path))  # which waits where many do
    connection.settimeout(5 * CLIENT_S)
    return connection


def test_a_crowd_is_served(path: Path) -> None:
    heard: list[object] = []
    crowd = [
        Thread(target=lambda number=number: heard.append(ask(path, {"n": number})["heard"])) for number in range(8)
    ]
    for one in crowd:
        one.start()
    for one in crowd:
        one.join()
    assert sorted(map(str, heard)) == [str({"n": number}) for number in range(8)]


def test_an_answer_that_nobody_takes_holds_nobody_up_and_ends(tmp_path: Path) -> None:
    """More than the kernel buffers, to a client that does not read, and to one that reads a byte now and then."""
    path, pause = tmp_path / "control.sock", Event()
    control = ControlSocket(path, lambda _: {"much": "x" * 5_000_000}, time.monotonic)
    control.start()
    try:
        with client(path) as deaf, client(path) as slow:
            deaf.sendall(b"{}\n")
            slow.sendall(b"{}\n")
            began_s = time.monotonic()
            while time.monotonic() - began_s < CLIENT_S / 2:
                assert len(slow.recv(1)) == 1
                assert len(str(ask(path, {}, timeout_s=SOON_S)["much"])) == 5_000_000
                pause.wait(0.02)
            wait_until(lambda: not control._clients, 2 * CLIENT_S, "the end of both")
    finally:
        control.close()


def test_an_answer_that_comes_later_keeps_nobody_waiting(tmp_path: Path) -> None:
    ready, said = Event(), []

    def slow(request: Mapping[str, object]) -> Answer | Later:
        return (lambda: {"at": "last"} if ready.is_set() else None) if request.get("verb") == "start" else {}

    with listening(tmp_path / "control.sock", slow):
        patient = Thread(target=lambda: said.append(ask(tmp_path / "control.sock", {"verb": "start"})))
        patient.start()
        answered_soon(tmp_path / "control.sock")
        assert said == []
        ready.set()
        patient.join()
    assert said == [{"ok": True, "at": "last"}]


@pytest.mark.parametrize("broken", [lambda: None, lambda: json.loads("lost")], ids=["never", "fails"])
def test_an_answer_that_never_comes_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: Later) -> None:
    monkeypatch.setattr(reception_module, "ANSWER_S", 0.1)
    with listening(tmp_path / "control.sock", lambda _: broken), pytest.raises(ServiceError, match="internal: "):
        ask(tmp_path / "control.sock", {"verb": "start"})


class Bays:
    """A handler that writes down what it was asked, and answers when it is let."""

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


def say(path: Path, clients: list[socket.socket], verb: str, bays: list[str] | None = None) -> socket.socket:
    connection = connected(path)
    clients.append(connection)
    connection.sendall(json.dumps({"verb": verb, "bays": bays}).encode() + b"\n")
    return connection


def test_a_stop_goes_first_and_what_it_overtook_is_not_done_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever asked for a start before the stop must ask again; what is for other bays stays."""
    monkeypatch.setattr(reception_module, "PAUSE_S", 0.5)
    bays, path = Bays(), tmp_path / "control.sock"
    bays.ready.set()
    with listening(path, bays), closing_all() as clients:
        assert reply(say(path, clients, "pause", ["bay-3"]))["ok"]
        early = [say(path, clients, "start"), say(path, clients, "start", ["bay-1"])]
        other = say(path, clients, "start", ["bay-2"])
        assert reply(say(path, clients, "stop", ["bay-1"]))["ok"]
        assert bays.asked == ["pause", "stop"]
        for one in early:
            assert reply(one) == {"ok": False, "error": "a stop came meanwhile: ask again if it is still wanted"}
        assert reply(other)["ok"]
        assert bays.asked == ["pause", "stop", "start"]


def test_one_stop_is_enough_for_all_who_say_the_same(tmp_path: Path) -> None:
    bays, path = Bays(), tmp_path / "control.sock"
    with listening(path, bays), closing_all() as clients:
        stops = [say(path, clients, "stop") for _ in range(20)]
        ask(path, {"verb": "status"})  # behind them
        assert bays.asked == ["stop"]
        say(path, clients, "start")
        wait_until(lambda: bays.asked == ["stop", "start"], what="the start")
        stops.append(say(path, clients, "stop"))  # after a start it is another one
        wait_until(lambda: bays.asked == ["stop", "start", "stop"], what="a stop of its own")
        bays.ready.set()
        assert all(reply(one)["ok"] for one in stops)


def test_those_who_ask_for_the_status_at_once_get_the_same_one(tmp_path: Path) -> None:
    bays, path = Bays(), tmp_path / "control.sock"
    bays.ready.set()
    with listening(path, bays), closing_all() as clients:
        crowd = [say(path, clients, "status") for _ in range(100)]
        assert {reply(one)["ok"] for one in crowd} == {True}
        assert bays.statuses < 50
        before = bays.statuses
        ask(path, {"verb": "stop"})
        assert ask(path, {"verb": "status"})["statuses"] == before + 1  # and none from before a request
        Event().wait(2 * SHARED_S)
        assert ask(path, {"verb": "status"})["statuses"] == before + 2


def test_requests_that_are_too_many_are_refused_in_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reception_module, "QUEUE_S", 0.2)
    monkeypatch.setattr(reception_module, "PAUSE_S", 60.0)
    bays, path = Bays(), tmp_path / "control.sock"
    bays.ready.set()
    with listening(path, bays), closing_all() as clients:
        crowd = [say(path, clients, "start", [f"bay-{number}"]) for number in range(3)]
        said = [reply(one) for one in crowd]
    assert sorted(bool(one["ok"]) for one in said) == [False, False, True], "whichever was read first"
    assert {one["error"] for one in said if not one["ok"]} == {"too many requests at once: ask again"}


#: What the first one takes of one processor, and how late a stop may be then: its rest and a few turns.
SHARE, STOP_S = 0.3, 0.5


def test_a_flood_takes_its_share_and_delays_no_stop(tmp_path: Path) -> None:
    """20 clients that ask without a pause, 100 that say nothing: in processes of their own, as they would be."""
    bays, path = Bays(), tmp_path / "control.sock"
    bays.ready.set()
    flood = (
        "import socket, sys\n"
        "while True:\n"
        "    with socket.socket(socket.AF_UNIX) as one:\n"
        "        one.connect(sys.argv[1]); one.sendall(sys.argv[2].encode() + b'\\n'); one.recv(100)\n"
    )
    with listening(path, bays), closing_all() as idle, ExitStack() as end:
        for number in range(20):
            request = json.dumps({"verb": ("status", "start", "nonsense")[number % 3]})
            flooding = end.enter_context(
                subprocess.Popen(["nice", sys.executable, "-c", flood, str(path), request], stderr=subprocess.DEVNULL)
            )
            end.callback(flooding.kill)
        wait_until(lambda: bays.statuses > 10, 20, "the flood")
        idle += [connected(path) for _ in range(100)]
        began_s, used_s = time.monotonic(), time.process_time()
        delays_s = []
        for _ in range(20):
            asked_s = time.monotonic()
            ask(path, {"verb": "stop"})
            delays_s.append(time.monotonic() - asked_s)
        used_s, took_s = time.process_time() - used_s, time.monotonic() - began_s
    assert max(delays_s) < STOP_S
    assert used_s < SHARE * took_s + 0.05


def test_a_handler_that_hangs_is_noticed(tmp_path: Path) -> None:
    path, free = tmp_path / "control.sock", Event()

    def hangs(_: Mapping[str, object]) -> Answer:
        free.wait()
        return {}

    with listening(path, hangs) as control:
        assert not control.stalled(time.monotonic() + STALL_S)
        with client(path) as asking:
            asking.sendall(b"{}\n")
            wait_until(lambda: control.stalled(time.monotonic() + STALL_S), what="a turn that lasts")
            assert not control.stalled(time.monotonic())
            free.set()
    wait_until(lambda: control.stalled(time.monotonic()), what="the end of its thread")


def test_clients_alone_are_no_stall(path: Path) -> None:
    with client(path):
        Event().wait(2 * REST_S)
        answered_soon(path)


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
        monkeypatch.setattr(Client, "peer", lambda _: (4711, 12345, 12345))
        for _ in range(3):
            with pytest.raises(ServiceError):
                ask(path, {})
        assert said == ["control socket: turned user 12345 away (process 4711; 1 since last said)"]
        Event().wait(2 * REST_S)  # the next one comes in another turn
        now_s[0] += SAY_S
        with pytest.raises(ServiceError):
            ask(path, {})
        assert said[1:] == ["control socket: turned user 12345 away (process 4711; 3 since last said)"]
    finally:
        control.close()


def test_requests_go_to_the_bays_at_their_pace(path: Path) -> None:
    began_s = time.monotonic()
    for _ in range(20):
        ask(path, {})
    assert time.monotonic() - began_s > 19 * PAUSE_S


# --- the other side ---------------------------------------------------------------------------------------------------


@contextmanager
def impostor(path: Path, serve: Callable[[socket.socket], object]) -> Iterator[None]:
    """Somebody else who answers there."""
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


@pytest.mark.parametrize("serve", [drip, lambda connection: connection.recv(100) and connection.recv(1)])
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
    """The kernel's queue is full; there is room after a while."""
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


# --- its name ---------------------------------------------------------------------------------------------------------


def test_a_name_that_somebody_removes_comes_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_module, "NAME_S", 0.05)
    said: list[str] = []
    path = tmp_path / "control.sock"
    control = ControlSocket(path, answer, time.monotonic, said.append)
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
    control = ControlSocket(path, answer, time.monotonic, said.append)
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


def test_a_defect_in_a_turn_sends_its_clients_away_and_the_next_one_is_served(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as broken:
        broken.setattr(Client, "hear", lambda *_: [].pop())
        with client(path) as there:
            assert there.recv(1) == b""
    answered_soon(path)


def test_a_link_to_nowhere_in_its_place_is_left_to_its_owner(tmp_path: Path) -> None:
    (tmp_path / "control.sock").symlink_to(tmp_path / "nowhere")
    with pytest.raises(ServiceError, match="is no socket"):
        ControlSocket(tmp_path / "control.sock", answer, time.monotonic)
