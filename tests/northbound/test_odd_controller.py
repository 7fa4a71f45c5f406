"""A controller that answers with something unexpected, line for line over a real socket."""

import asyncio
import json
import socket
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

import pytest

from orchestrator.northbound import closely, link
from orchestrator.northbound.link import Link
from tests.northbound.bench import Browser, page

DEEP = b"[" * 100_000 + b"]" * 100_000
NONSENSE = [
    b"null", b"[]", b"7", b'"ok"', b"{", b"", b"{}", b'{"ok": false}', b'{"ok": true}', DEEP,
    b'{"ok": true, "results": null, "bays": null}', b'{"ok": true, "results": {}, "bays": []}',
    b'{"ok": true, "results": {"bay-1": null}, "bays": [null]}',
    b'{"ok": true, "results": {"bay-1": 7}, "bays": [{"name": "bay-1"}]}',
    b'{"ok": true, "results": {"bay-1": ""}, "causes": [1], "bays": [{}]}',
    b'{"ok": true, "results": {"bay-1": ""}, "causes": {"bay-1": NaN}, '
    b'"bays": [{"name": "bay-1", "reason": "", "faults": [], "x": NaN}]}',
    b'{"ok": true, "results": {"bay-1": ["x"]}, "bays": [{"name": "bay-2", "reason": "", "faults": []}]}',
]  # fmt: skip


class Odd:
    """Answers every line with the same one."""

    def __init__(self, path: Path) -> None:
        self.line = b"null"
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen(64)
        Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            client, _ = self._listener.accept()
            Thread(target=self._answer, args=(client,), daemon=True).start()

    def _answer(self, client: socket.socket) -> None:
        with client, client.makefile("rb") as asked:
            if asked.readline():
                client.sendall(self.line + b"\n")


@pytest.fixture(name="pair", scope="module")
def _pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Browser, Odd]]:
    directory = tmp_path_factory.mktemp("odd")
    odd = Odd(directory / "orchestrator.sock")
    with page(directory, controller=False) as (browser, _):
        yield browser, odd


@pytest.mark.parametrize("line", NONSENSE, ids=lambda line: line[:40])
def test_nobody_is_told_that_it_is_done(
    pair: tuple[Browser, Odd], line: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    browser, odd = pair
    odd.line = line
    monkeypatch.setattr(closely, "KEPT_S", 0.0)
    for action, more in (("stop", {}), ("start", {"since": 7.0}), ("start", {})):
        answer = browser.post("/api/request?language=ko", {"action": action, "bay": "bay-1", **more})
        assert (answer.status, answer.error) in ((503, "controller_silent"), (409, "bay_changed"))
        assert answer.status == 503 or more, "only what was compared can have changed"
    answer = browser.get("/api/bay?bay=bay-1&language=ko")
    assert (answer.status, answer.error) in ((503, "bay_odd"), (503, "no_journal"))


def test_half_a_surrogate_pair_is_told_as_it_was_sent(pair: tuple[Browser, Odd]) -> None:
    browser, odd = pair
    odd.line = b'{"ok": true, "results": {"bay-1": "\\udc80"}}'
    answer = browser.post("/api/request", {"action": "stop", "bay": "bay-1"})
    assert (answer.status, answer.json["text"]) == (200, "\udc80")


def test_a_line_without_an_end_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert link.MOST_LINE <= 8 * 2**20
    monkeypatch.setattr(link, "MOST_LINE", 1 << 16)
    odd = Odd(tmp_path / "orchestrator.sock")
    odd.line = b'{"document": {"bays": [], "x": "' + b"x" * (1 << 17) + b'"}}'
    with page(tmp_path, controller=False) as (browser, _):
        assert browser.get("/api/status").json["document"] is None


def test_when_the_controller_was_last_heard_stays_over_connections_that_tell_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_s, seen = [100.0], list[tuple[bool, float]]()
    monkeypatch.setattr(link, "time", lambda: now_s[0])
    monkeypatch.setattr(link, "RETRY_S", 0.05)
    monkeypatch.setattr(link, "LONGEST_S", 0.05)
    nothing = (b"", b"{}\n", b'{"bays": {}}\n', b'{"bays": {"bay-1": {}}}\n', b'{"document": {}}\n', b"null\n")
    document = json.dumps({"document": {"bays": [{"name": "bay-1"}]}}).encode() + b"\n"
    scripts = [(b"{}\n",), (document, b"{}\n"), *((one,) for one in nothing)]

    async def go_on(directory: str) -> None:
        path, left, done = Path(directory) / "s", list(scripts), asyncio.Event()

        async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            await reader.readline()
            for line in left.pop(0) if left else ():
                now_s[0] += 1.0
                writer.write(line)
                await asyncio.sleep(0.01)
                seen.append((upstream.connected, upstream.since_s))
            now_s[0] += 5.0
            writer.close()
            if not left:
                done.set()

        upstream = Link(lambda: [path])
        server = await asyncio.start_unix_server(answer, path)
        task = asyncio.create_task(upstream.run())
        await asyncio.wait_for(done.wait(), 5.0)
        task.cancel()
        server.close()

    with TemporaryDirectory() as directory:
        asyncio.run(go_on(directory))
    connected_s, heard_s = 107.0, 108.0
    assert seen == [(False, 100.0), (True, connected_s), (True, connected_s), *[(False, heard_s)] * len(nothing)]
