"""The server as a browser and its enemies meet it, over real sockets, with a real control socket behind it."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.northbound import connection, guard, password, stream
from orchestrator.northbound.password import hashed
from tests.northbound.bench import JSON, SOON_S, Browser, Controller, bay, page
from tests.waiting import wait_until

Pair = tuple[Browser, Controller]


@pytest.fixture(name="pair", scope="module")
def _pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    """Everybody is an operator."""
    with page(tmp_path_factory.mktemp("open")) as pair:
        yield pair


@pytest.fixture(name="closed", scope="module")
def _closed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    """Kim is an operator, and Lee a viewer."""
    directory, before = tmp_path_factory.mktemp("closed"), password.N
    password.N = 2**4
    lines = [
        f"  {name}: {{role: {role}, password: '{hashed(name + ' secret')}'}}\n"
        for name, role in (("kim", "operator"), ("lee", "viewer"))
    ]
    file = directory / "users.yaml"
    file.touch(0o600)
    file.write_text("".join(["users:\n", *lines]), encoding="utf-8")
    with page(directory, "users: users.yaml\n") as pair:
        yield pair
    password.N = before


@pytest.fixture(name="browser")
def _browser(closed: Pair) -> Browser:
    """Of somebody who is not logged in."""
    return Browser(closed[0].port)


# --- what it tells ---


def test_a_stream_begins_with_the_whole_and_goes_on_with_changes(pair: Pair) -> None:
    browser, station = pair
    with browser.stream("?language=ko") as events:
        assert b"text/event-stream" in events.head
        _, id_, whole = events.next("whole")
        assert id_ == str(whole["revision"])
        assert whole["me"] == {"name": "", "role": "operator"}
        assert whole["page"]["version"]
        assert [one["name"] for one in whole["document"]["bays"]] == ["bay-1", "bay-2"]
        assert whole["document"]["bays"][0]["reason"].startswith("팩 온도가")
        station.document = {**station.document, "bays": [bay("bay-1"), bay("bay-2", "FULL")]}
        _, id_, change = events.next("change")
        assert int(id_) > whole["revision"]
        assert list(change["bays"]) == ["bay-2"]
        assert (change["station"], change["gone"]) == ({}, [])
    with browser.stream(Last_Event_ID=str(whole["revision"])) as events:
        _, _, change = events.next("change")
        assert list(change["bays"]) == ["bay-2"]


def test_a_browser_gets_the_same_packed(pair: Pair) -> None:
    browser, station = pair
    with browser.stream("?language=ko", Accept_Encoding="gzip, br") as events:
        assert b"content-encoding: gzip" in events.head
        unpacked = events.unpacked()
        assert unpacked.next("whole")[2]["document"]["bays"][0]["reason"].startswith("팩 온도가")
        for alarm in ("danger", "none"):
            station.document = {**station.document, "alarm": alarm}
            assert unpacked.next("change")[2]["station"] == {"alarm": alarm}


def test_the_long_poll_tells_the_same(pair: Pair) -> None:
    browser, station = pair
    wait_until(lambda: browser.get("/api/status").json["document"])
    whole = browser.get("/api/status").json
    assert whole["link"]["connected"]
    station.document = {**station.document, "alarm": "attention"}
    change = browser.get(f"/api/status?after={whole['revision']}").json
    assert change["station"] == {"alarm": "attention"}
    assert browser.get("/api/status?after=nonsense").status == 400


def test_a_controller_that_goes_and_comes_back_is_told(tmp_path: Path) -> None:
    with page(tmp_path, controller=False) as (browser, station), browser.stream() as events:
        assert events.next()[2]["connected"] is False
        station.begin()
        assert events.next("link")[2]["connected"] is True
        assert events.next("whole")[2]["document"]["station"] == "hall"
        station.end()
        assert events.next("link")[2]["connected"] is False
        answer = browser.post("/api/request", {"action": "stop", "bay": "bay-1"})
        assert (answer.status, answer.error) == (503, "controller_silent")


@pytest.mark.parametrize(
    "nonsense", [{}, {"bays": 7}, {"bays": [{}]}, {"bays": [[]]}, {"bays": [{"name": {}}], "time": "x"}]
)
def test_what_is_no_status_is_no_connection(tmp_path: Path, nonsense: dict[str, object]) -> None:
    with page(tmp_path) as (browser, station), browser.stream() as events:
        events.next("whole")
        sensible, station.document = station.document, nonsense
        assert events.next("link")[2]["connected"] is False
        station.document = sensible
        assert events.next("link")[2]["connected"] is True


def test_a_reader_that_does_not_read_is_dropped_and_the_others_go_on(
    pair: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser, station = pair
    monkeypatch.setattr(connection, "UNREAD_S", 0.1)
    before, much = station.document, [{**bay(f"much-{number}"), "padding": "x" * 100_000} for number in range(10)]
    with browser.stream() as events, socket.socket() as lazy:
        station.document = {**before, "bays": [*before["bays"], *much]}
        assert len(events.next("change")[2]["bays"]) == 10
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        lazy.settimeout(SOON_S)
        lazy.connect(("127.0.0.1", browser.port))
        lazy.sendall(b"GET /api/stream HTTP/1.1\r\nHost: localhost\r\n\r\n")
        time.sleep(0.3)
        station.document = before
        assert len(events.next("change")[2]["gone"]) == 10
        assert sum(map(len, iter(lambda: lazy.recv(1 << 16), b""))) < 1_000_000, "the rest is not sent any more"


def test_no_more_streams_than_there_are_places(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    browser, _ = pair
    monkeypatch.setattr(stream, "MOST", 1)
    wait_until(lambda: b" 200 " in _head(browser))
    with browser.stream() as first:
        assert b" 200 " in first.head
        with browser.stream() as second:
            assert b" 503 " in second.head
    wait_until(lambda: b" 200 " in _head(browser))


def _head(browser: Browser) -> bytes:
    with browser.stream() as events:
        return events.head


# --- what it is asked ---


def test_a_request_goes_to_the_controller_with_who_asks(pair: Pair) -> None:
    browser, station = pair
    station.asked.clear()
    answer = browser.post("/api/request", {"action": "stop", "bay": "bay-1", "because": "wet floor"})
    assert (answer.status, answer.json["ok"], answer.json["text"]) == (200, True, "bay-1: stop accepted")
    (asked,) = station.asked
    assert (asked["verb"], asked["bays"], asked["because"]) == ("stop", ["bay-1"], "wet floor")
    assert asked["by"] == "page, 127.0.0.1"


def test_what_the_controller_refuses_is_told_in_the_readers_language(pair: Pair) -> None:
    browser, _ = pair
    answer = browser.post("/api/request?language=ko", {"action": "start", "bay": "bay-9"})
    assert (answer.status, answer.json["ok"]) == (200, False)
    assert answer.json["text"].startswith("팩 온도가")
    assert answer.json["cause"]["id"] == "over_temperature"


@pytest.mark.parametrize(
    "body",
    [
        {}, [], None, 7, {"action": "stop"}, {"action": "stop", "bay": ""}, {"action": "stop", "bay": 7},
        {"action": "stop", "bay": "x" * 65}, {"action": "stop", "bay": "a\nb"}, {"action": "estop", "bay": "bay-1"},
        {"action": "reload", "bay": "bay-1"}, {"action": "stop", "bay": "bay-1", "because": "x" * 201},
        {"action": "stop", "bay": ["bay-1"]}, {"action": ["stop"], "bay": "bay-1"},
    ],
    ids=str,
)  # fmt: skip
def test_what_is_no_request_reaches_nobody(pair: Pair, body: object) -> None:
    browser, station = pair
    station.asked.clear()
    answer = browser.post("/api/request", body)
    assert answer.status == 400
    assert answer.json["text"]
    assert station.asked == []


# --- who may ---


def test_who_has_not_logged_in_sees_nothing_and_does_nothing(browser: Browser, closed: Pair) -> None:
    for path in ("stream", "status", "sessions", "sessions/1", "sessions.csv", "batteries", "batteries/1", "events"):
        assert browser.get(f"/api/{path}").status == 401, path
    assert browser.post("/api/request", {"action": "stop", "bay": "bay-1"}).status == 401
    assert browser.get("/api/me").json == {"me": None, "login": True}
    assert closed[1].asked == []


def test_a_viewer_looks_and_does_not_act(browser: Browser, closed: Pair) -> None:
    assert browser.login("lee", "lee secret").json["me"] == {"name": "lee", "role": "viewer"}
    with browser.stream() as events:
        assert events.next("whole")[2]["me"] == {"name": "lee", "role": "viewer"}
    for action in ("start", "pause", "stop", "reset"):
        answer = browser.post("/api/request", {"action": action, "bay": "bay-1"})
        assert (answer.status, answer.error) == (403, "role_too_low")
    assert closed[1].asked == []


def test_an_operator_acts_in_his_own_name_until_he_logs_out(browser: Browser, closed: Pair) -> None:
    browser.login("kim", "kim secret")
    assert browser.post("/api/request", {"action": "stop", "bay": "bay-1", "by": {"user": "lee"}}).json["ok"]
    assert closed[1].asked.pop()["by"] == "page, kim, 127.0.0.1"
    session = browser.cookie
    assert browser.post("/api/logout", {}).status == 200
    browser.cookie = session
    assert browser.post("/api/request", {"action": "stop", "bay": "bay-1"}).status == 401


def test_a_stream_ends_with_its_session(browser: Browser, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "ALIVE_S", 0.05)
    browser.login("lee", "lee secret")
    with browser.connected() as reader:
        reader.sendall(f"GET /api/stream HTTP/1.0\r\nHost: localhost\r\nCookie: {browser.cookie}\r\n\r\n".encode())
        browser.post("/api/logout", {})
        while reader.recv(1 << 16):
            pass


def test_a_login_makes_a_new_session_whatever_the_browser_had(browser: Browser) -> None:
    browser.cookie = "orchestrator_session=chosen-by-somebody-else"
    answer = browser.login("lee", "lee secret")
    flags = answer.headers["Set-Cookie"]
    assert "chosen-by" not in flags
    assert all(flag in flags for flag in ("HttpOnly", "SameSite=Strict", "Path=/", "Max-Age=43200"))
    first = browser.cookie
    browser.login("lee", "lee secret")
    assert browser.cookie != first
    browser.cookie = first
    assert browser.get("/api/me").json["me"] is None, "a login ends the session that it was made in"


def test_wrong_logins_look_alike_slow_down_and_are_told(closed: Pair, capfd: pytest.CaptureFixture[str]) -> None:
    browser = Browser(closed[0].port)
    answers = [browser.login(name, "wrong") for name in ("kim", "nobody", "nobody", "kim", "nobody", "kim", "kim")]
    assert [answer.status for answer in answers] == [401] * 6 + [429]
    assert answers[0].json == answers[1].json
    assert int(answers[-1].headers["Retry-After"]) >= 1
    assert capfd.readouterr().err.count("a login as kim from 127.0.0.1 has failed") == 3
    assert browser.login("kim", "kim secret").status == 429, "even the right one has to wait"


# --- its enemies ---


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Content-Type": "text/plain"}, 415),
        ({"Content-Type": "application/x-www-form-urlencoded"}, 415),
        ({"Host": "evil.example"}, 421),
    ],
)
def test_a_request_by_way_of_another_page_is_refused(pair: Pair, headers: dict[str, str], status: int) -> None:
    browser, station = pair
    station.asked.clear()
    body = json.dumps({"action": "start", "bay": "bay-1"}).encode()
    answer = browser.send("POST", "/api/request", body, {**JSON, **headers})
    assert answer.status == status
    assert answer.json["ok"] is False
    assert station.asked == []


def test_every_answer_has_the_headers_that_keep_other_pages_out(pair: Pair) -> None:
    for path in ("/api/me", "/nothing", "/static/nothing.js"):
        headers = pair[0].get(path).headers
        assert headers["Content-Security-Policy"].startswith("default-src 'self';")
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        assert "unsafe" not in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert "Server" not in headers
        assert "Access-Control-Allow-Origin" not in headers


@pytest.mark.parametrize(
    "path",
    [
        "/static/../serve.py", "/static/%2e%2e/serve.py", "/static/..%2fserve.py", "/static//etc/passwd",
        "/static/%2fetc%2fpasswd", "/static/....//serve.py", "/static/\\..\\serve.py", "/static/", "/static/%00",
        "/../etc/passwd", "/bay/a/b", "/api", "/api/", "/api/stream/", "/api/sessions/../me",
    ],
)  # fmt: skip
def test_no_path_leads_anywhere_else(pair: Pair, path: str) -> None:
    answer = pair[0].get(path)
    assert (answer.status, answer.error) == (404, "nothing_here")


def test_another_method_is_refused(pair: Pair) -> None:
    browser, _ = pair
    assert browser.post("/api/stream", {}).status == 405
    assert browser.get("/api/request").status == 405
    for method in ("PUT", "DELETE", "OPTIONS", "PATCH"):
        assert browser.send(method, "/api/request", None, {}).status == 405


def raw(browser: Browser, text: bytes) -> bytes:
    """What comes back until the connection is closed; b"" if nothing does."""
    with browser.connected() as attacker:
        try:
            attacker.sendall(text)
            return b"".join(iter(lambda: attacker.recv(1 << 16), b""))
        except ConnectionError:
            return b""


def test_a_head_of_a_megabyte_is_cut_off(pair: Pair) -> None:
    told = raw(pair[0], b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * 1_000_000)
    assert told == b"" or told.startswith(b"HTTP/1.1 400 ")
    assert pair[0].get("/api/me").status == 200


def test_what_is_no_http_gets_a_sentence(pair: Pair) -> None:
    told = raw(pair[0], b"\x16\x03\x01 hello\r\n\r\n")
    assert told.startswith(b"HTTP/1.1 400 ")
    assert b'"error":"head_wrong"' in told


def test_a_body_that_is_too_long_is_refused(pair: Pair) -> None:
    assert pair[0].post("/api/request", {"action": "stop", "bay": "x" * 20_000}).status in (400, 413)
    big = {**JSON, "Content-Length": str(10**9)}
    assert pair[0].send("POST", "/api/request", b"{" + b" " * 20_000, big).status == 413


def test_a_head_that_drips_is_cut_off(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "HEAD_S", 0.2)
    with pair[0].connected() as slow:
        cut, began_s = select.poll(), time.monotonic()
        cut.register(slow, select.POLLRDHUP | select.POLLHUP | select.POLLERR)
        for byte in b"GET /api/me HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * 10_000:
            slow.sendall(bytes([byte]))
            if cut.poll(10):  # a byte each hundredth of a second, until the other end has had enough
                break
        assert cut.poll(0)
        assert time.monotonic() - began_s < SOON_S


def test_a_body_that_does_not_come_is_not_waited_for(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "BODY_S", 0.1)
    head = (
        b"POST /api/request HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 9\r\n\r\n{"
    )
    assert raw(pair[0], head).startswith(b"HTTP/1.1 408 ")


def test_idle_connections_make_room(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    browser, _ = pair
    monkeypatch.setattr(connection, "MOST", 3)
    idle = [socket.create_connection(("127.0.0.1", browser.port)) for _ in range(6)]
    assert browser.get("/api/me").status == 200
    for one in idle:
        one.close()


def test_an_error_of_our_own_is_a_sentence_and_not_a_traceback(
    pair: Pair, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("orchestrator.northbound.app.json_response", lambda _: 1 / 0)
    answer = pair[0].get("/api/me")
    assert (answer.status, answer.error) == (500, "page_failed")
    assert b"Zero" not in answer.body
    said = capfd.readouterr().err
    assert "ZeroDivisionError" in said
    assert "Traceback" not in said


# --- the process ---


def test_it_says_where_it_is_and_ends_at_once(tmp_path: Path) -> None:
    with page(tmp_path):  # which writes the files
        pass
    command = [sys.executable, "-P", "-m", "orchestrator", "serve", "northbound.yaml"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path) as process:
        assert process.stdout is not None
        first = process.stdout.readline().decode()
        browser = Browser(int(first.rstrip("/\n").rpartition(":")[2]))
        assert first.endswith(f"http://127.0.0.1:{browser.port}/\n")
        with browser.stream() as events:
            assert events.next("link")[2]["connected"] is False
            os.kill(process.pid, signal.SIGTERM)
            began_s = time.monotonic()
            assert process.wait(SOON_S) == 0
            assert time.monotonic() - began_s < 2.0
        assert process.stderr is not None
        assert process.stderr.read() == b""
