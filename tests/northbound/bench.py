"""A page's server in a thread, a controller's socket with a made-up station, and a browser that tells what it gets."""

import asyncio
import http.client
import json
import socket
import time
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any, cast

from orchestrator.config.load import load_northbound
from orchestrator.config.northbound import Tls
from orchestrator.config.northbound_rules import Listen
from orchestrator.errors import RequestError
from orchestrator.model import Cause
from orchestrator.northbound import link
from orchestrator.northbound.serve import assembled, certificate, listening
from orchestrator.service.control import ControlSocket
from orchestrator.service.streams import Streams

SOON_S = 5.0
JSON = {"Content-Type": "application/json"}
HOT = {"id": "over_temperature", "params": {"pack_c": 45.23, "limit_c": 45, "again_c": 40.0}, "key": "", "place": "p:3"}


def bay(name: str, state: str = "IDLE", cause: Mapping[str, Any] = HOT) -> dict[str, Any]:
    """As much of a bay's entry as matters here."""
    device = {"online": True, "problem": "", "cause": None}
    return {
        "name": name, "state": state, "reason": "it is hot", "cause": {**cause, "advice": "", "text": "it is hot"},
        "faults": [], "alarm": "none", "charger": {**device, "t_s": 1.0, "age_s": 0.1, "old": False},
        "battery": {**device, "age_s": {}, "old": []},
    }  # fmt: skip


class Controller:
    """A control socket; what it is asked for is kept, and it refuses to start `bay-9`."""

    def __init__(self, directory: Path) -> None:
        self.path = directory / "orchestrator.sock"
        self.document: dict[str, Any] = {
            "station": "hall", "language": "en", "alarm": "none", "bays": [bay("bay-1"), bay("bay-2")]
        }  # fmt: skip
        self.asked: list[Mapping[str, object]] = []
        self._socket: ControlSocket | None = None

    def begin(self, streams: Streams | None = None) -> None:
        watch = streams.take if streams is not None else None
        self._socket = ControlSocket(self.path, self._answer, time.monotonic, watch=watch)
        self._socket.start()

    def end(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _answer(self, request: Mapping[str, object]) -> Mapping[str, object]:
        if request["verb"] == "status":
            return self.document
        if request["verb"] == "watch":
            raise RequestError(Cause.of("verb_unknown", verb="watch", verbs=()))
        self.asked.append(request)
        (name,) = cast("list[str]", request["bays"])
        refused = name == "bay-9"
        causes = {name: {**HOT, "advice": ""}} if refused else {}
        return {"language": "en", "results": {name: "too hot" if refused else ""}, "causes": causes}


@contextmanager
def page(
    directory: Path, more: str = "", *, controller: bool = True, tls: Tls | None = None
) -> Iterator[tuple["Browser", Controller]]:
    """A server of its own on any port. `more` are further lines of its file."""
    station = Controller(directory)
    (directory / "station.yaml").write_text(
        "control: {socket: orchestrator.sock}\njournal: {directory: journal}\nbays: []\n", encoding="utf-8"
    )
    file = directory / "northbound.yaml"
    file.write_text(f"station: station.yaml\npage: {{listen: 127.0.0.1:0}}\n{more}", encoding="utf-8")
    northbound = load_northbound(file)
    listener = listening(Listen.of(northbound.page.listen))
    port = listener.getsockname()[1]
    ended, begun, loops = Event(), Event(), list[asyncio.AbstractEventLoop]()

    async def serve() -> None:
        server, upstream = assembled(northbound, listener, certificate(tls) if tls is not None else None)
        loops.append(asyncio.get_running_loop())
        task = asyncio.create_task(upstream.run())
        begun.set()
        while not ended.is_set():
            served = asyncio.create_task(server.serve())
            await asyncio.to_thread(ended.wait)
            server.should_exit = True
            await served
        task.cancel()

    link.POLL_S, link.RETRY_S = 0.02, 0.05
    thread = Thread(target=asyncio.run, args=(serve(),), daemon=True)
    if controller:
        station.begin()
    thread.start()
    try:
        assert begun.wait(SOON_S)
        yield Browser(port), station
    finally:
        ended.set()
        thread.join(SOON_S)
        station.end()


class Answer:
    """What came back."""

    def __init__(self, response: http.client.HTTPResponse) -> None:
        self.status, self.headers, self.body = response.status, response.headers, response.read()

    @property
    def json(self) -> Any:
        return json.loads(self.body)

    @property
    def error(self) -> str:
        return str(self.json["error"])


class Browser:
    """One that keeps its cookie."""

    def __init__(self, port: int) -> None:
        self.port, self.cookie = port, ""

    @property
    def own(self) -> dict[str, str]:
        return {"Cookie": self.cookie} if self.cookie else {}

    def get(self, path: str, **headers: str) -> Answer:
        return self.send("GET", path, None, {**self.own, **headers})

    def post(self, path: str, value: object, **headers: str) -> Answer:
        return self.send("POST", path, json.dumps(value).encode(), {**JSON, **self.own, **headers})

    def send(self, method: str, path: str, body: bytes | None, headers: Mapping[str, str]) -> Answer:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=SOON_S)
        try:
            connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
            answer = Answer(connection.getresponse())
        finally:
            connection.close()
        if set_ := answer.headers.get("Set-Cookie"):
            self.cookie = set_.partition(";")[0]
        return answer

    def login(self, name: str, password: str) -> Answer:
        return self.post("/api/login", {"name": name, "password": password})

    @contextmanager
    def stream(self, query: str = "", **headers: str) -> Iterator["Stream"]:
        with self.connected() as connection:
            lines = "".join(f"{name.replace('_', '-')}: {value}\r\n" for name, value in {**self.own, **headers}.items())
            connection.sendall(f"GET /api/stream{query} HTTP/1.1\r\nHost: localhost\r\n{lines}\r\n".encode())
            events = Stream(connection)
            try:
                yield events
            finally:
                events.close()

    @contextmanager
    def connected(self) -> Iterator[socket.socket]:
        with socket.create_connection(("127.0.0.1", self.port), timeout=SOON_S) as connection:
            yield connection


class Unpacked:
    """The lines of a chunked gzip stream, each as soon as it has come."""

    def __init__(self, file: Any) -> None:
        self._file, self._unpacker, self._text = file, zlib.decompressobj(16 + zlib.MAX_WBITS), b""

    def readline(self) -> bytes:
        while b"\n" not in self._text:
            size = int(self._file.readline(), 16)
            self._text += self._unpacker.decompress(self._file.read(size))
            self._file.readline()
        line, _, self._text = self._text.partition(b"\n")
        return line + b"\n"

    def close(self) -> None:
        self._file.close()


class Stream:
    """The events of a stream, one after the other."""

    def __init__(self, connection: socket.socket) -> None:
        self._file: Any = connection.makefile("rb")
        self.head = b"".join(iter(self._file.readline, b"\r\n"))

    def unpacked(self) -> "Stream":
        """The same for a reader that has asked for gzip."""
        self._file = Unpacked(self._file)
        return self

    def close(self) -> None:
        self._file.close()

    def next(self, wanted: str = "") -> tuple[str, str, Any]:
        """Name, id and data of the next event, or of the next with this name."""
        while True:
            fields: dict[str, str] = {}
            while line := self._file.readline().decode().strip():
                name, _, value = line.partition(": ")
                fields[name] = value
            if "data" in fields and wanted in ("", fields["event"]):
                return fields["event"], fields.get("id", ""), json.loads(fields["data"])
