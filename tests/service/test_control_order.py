"""The order of answers at the control socket: stops first, one status for many, requests at a limited rate."""

import json
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from threading import Event, Thread

import pytest

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.service import reception as reception_module
from orchestrator.service.control import STALL_S
from orchestrator.service.reception import PAUSE_S, SHARED_S, Answer, Later, refused
from tests.service.control_bench import Bays, answered_soon, client, closing_all, connected, listening, reply
from tests.waiting import wait_until


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


def say(path: Path, clients: list[socket.socket], verb: str, bays: list[str] | None = None) -> socket.socket:
    connection = connected(path)
    clients.append(connection)
    connection.sendall(json.dumps({"verb": verb, "bays": bays}).encode() + b"\n")
    return connection


def test_a_stop_goes_first_and_what_it_overtook_is_not_done_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A start requested before the stop must be requested again; requests for other bays stay."""
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
            assert reply(one) == refused(Cause("overtaken"), "en")
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


def test_requests_go_to_the_bays_at_their_pace(path: Path) -> None:
    began_s = time.monotonic()
    for _ in range(20):
        ask(path, {})
    assert time.monotonic() - began_s > 19 * PAUSE_S
