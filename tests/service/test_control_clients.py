"""Clients of the control socket that are slow, rude, silent, foreign, or too many."""

import json
import os
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Event, Thread

import pytest

from orchestrator.errors import ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.service.client import CLIENT_S, Client
from orchestrator.service.control import MAX_CLIENTS, REST_S, ControlSocket
from orchestrator.service.doorkeeper import SAY_S
from tests.core.said import into
from tests.service.control_bench import (
    SOON_S,
    Bays,
    answer,
    answered_soon,
    client,
    closing_all,
    connected,
    listening,
    reply,
)
from tests.waiting import wait_until


def test_one_who_leaves_at_once_harms_nobody(path: Path) -> None:
    for _ in range(20):
        with client(path):
            pass
    with client(path) as connection:
        connection.sendall(b"{}\n")  # without waiting for the answer
    assert ask(path, {})["ok"]


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
        for _ in range(MAX_CLIENTS - 2):  # the longest silent are dropped
            idle.append(connected(path))
        half.sendall(b"}\n")
        assert reply(half)["ok"] is True


def test_a_crowd_is_served(path: Path) -> None:
    heard: list[object] = []
    crowd = [
        Thread(target=lambda number=number: heard.append(ask(path, {"n": number})["heard"])) for number in range(8)
    ]
    for one in crowd:
        one.start()
    for one in crowd:
        one.join()
    assert sorted(map(str, heard)) == [str({"n": number, "uid": os.getuid()}) for number in range(8)]


def test_an_answer_that_nobody_takes_holds_nobody_up_and_ends(tmp_path: Path) -> None:
    """More than the kernel buffers, to a client that never reads, and to one reading a byte now and then."""
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


#: The first one's share of a processor, and the delay a stop may have: its rest and a few turns.
SHARE, STOP_S = 0.3, 0.5


def test_a_flood_takes_its_share_and_delays_no_stop(tmp_path: Path) -> None:
    """20 clients asking without a pause and 100 silent ones, in separate processes as in reality."""
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


def test_clients_alone_are_no_stall(path: Path) -> None:
    with client(path):
        Event().wait(2 * REST_S)
        answered_soon(path)


def test_too_many_open_files_are_no_end(tmp_path: Path) -> None:
    """In a process of its own: another test's thread may close a file in this one at any moment."""
    command = [sys.executable, "-m", "tests.service.no_more_files", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 0, ended.stderr


def test_a_stranger_is_turned_away_and_that_is_said_once_a_minute(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    now_s = [1000.0]
    path = tmp_path / "control.sock"
    control = ControlSocket(path, answer, lambda: now_s[0], into(said))
    control.start()
    try:
        monkeypatch.setattr(Client, "peer", lambda _: (4711, 12345, 12345))
        for _ in range(3):
            with pytest.raises(ServiceError):
                ask(path, {})
        assert said == ["control socket: turned user 12345 away (process 4711; 1 since last said)"]
        Event().wait(2 * REST_S)  # the next one comes in a later turn
        now_s[0] += SAY_S
        with pytest.raises(ServiceError):
            ask(path, {})
        assert said[1:] == ["control socket: turned user 12345 away (process 4711; 3 since last said)"]
    finally:
        control.close()


def test_a_defect_in_a_turn_sends_its_clients_away_and_the_next_one_is_served(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as broken:
        broken.setattr(Client, "hear", lambda *_: [].pop())
        with client(path) as there:
            assert there.recv(1) == b""
    answered_soon(path)
