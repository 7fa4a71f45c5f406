"""The control socket: any bytes from a client to the service's own handler, and the answer as sent."""

import json
import re
import socket
import sys
from collections.abc import Mapping
from selectors import EVENT_READ
from time import monotonic
from typing import Any

from orchestrator.config.load import load_station
from orchestrator.model import Request
from orchestrator.service import client
from orchestrator.service.guarded import GuardianLink
from orchestrator.service.ports import ChargerPorts
from orchestrator.service.supervisor import Supervisor
from tests.fuzz.target import Target, kind_of_word, scratch

#: The longest answer: two bays' status, or an error quoting a name as long as a request, escaped.
MAX_ANSWER = 32 * 1024
BAYS = ("bay-1", "bay-2")
STATION = """
station: s
can: {can0: {interface: virtual, channel: fuzz}}
bays:
  - &
control: {socket: control.sock}
journal: {directory: journal}
"""
BAY = (
    "{name: %s, charger: {port: /nowhere/%s, control: manual, steps_a: [2, 5, 8, 11, 14]}, "
    "battery: {can: can0, node_id: %d, map: tabos}, limits: {voltage_v: 58.4, current_a: 15, temperature_c: [0, 45]}, "
    "policy: li-ion-48v}"
)


class Loop:
    """The control loop and its queue: one decision per bay and turn, however many reports arrive."""

    def __init__(self, supervisor: Supervisor) -> None:
        self._supervisor = supervisor
        self.stepped: set[int] = set()

    def put(self, number: int) -> None:
        if number not in self.stepped:
            self.stepped.add(number)
            self._supervisor._bays[number].run(monotonic())
            self._supervisor._bays[number].answer()  # no disk to wait for


def _service() -> tuple[Supervisor, Loop]:
    """A service without running threads: silent devices, real answers."""
    directory = scratch()
    bays = "\n  - ".join(BAY % (name, name, 16 + number) for number, name in enumerate(BAYS))
    (directory / "station.yaml").write_text(STATION.replace("&", bays), encoding="utf-8")
    ours, _theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    station, guardian = load_station(directory / "station.yaml"), GuardianLink(ours.detach())
    supervisor = Supervisor(station, guardian, ChargerPorts(station, guardian))
    supervisor._store.persisted_revision = sys.maxsize  # the disk is instantaneous
    loop = Loop(supervisor)
    supervisor._sockets.handler._wake = loop.put
    return supervisor, loop


SUPERVISOR, LOOP = _service()


def one(data: bytes) -> None:
    """A client that sends this, and closes."""
    LOOP.stepped.clear()
    for bay in SUPERVISOR._bays:
        bay._requests.take()
    ours, theirs = socket.socketpair()
    with theirs:
        theirs.sendall(data)
        theirs.shutdown(socket.SHUT_WR)
        line = _answered(ours, theirs)
    assert len(line) <= MAX_ANSWER and line.count(b"\n") == 1
    said: dict[str, Any] = json.loads(line)
    assert said["ok"] in (True, False)
    if said["ok"]:
        _is_what_was_asked(client.parse_request(data[: client.MAX_REQUEST]), said)
    else:
        assert said["error"] and not said["error"].startswith("internal"), said["error"]
    for bay in SUPERVISOR._bays:
        assert not bay._requests, "requests wait that somebody believes answered"
        assert not bay._internal, bay._internal


def _answered(ours: socket.socket, theirs: socket.socket) -> bytes:
    """The answer after the control socket's turns."""
    server = SUPERVISOR._sockets.control
    one = client.Client(ours, monotonic())
    server._clients.add(one)
    server._selector.register(one, EVENT_READ)
    server._serve(one, monotonic())
    while one in server._clients:
        if one.answering or not server._reception.busy:
            server._serve(one, monotonic())
        server._reception._request_s = 0.0  # without the pause between two requests
        server._reception.work(monotonic())
    with theirs.makefile("rb") as stream:
        return stream.readline()


def _is_what_was_asked(request: Mapping[str, object], said: dict[str, Any]) -> None:
    if request["verb"] == "status":
        assert [bay["name"] for bay in said["bays"]] == (
            [request["bay"]] if request.get("bay") is not None else list(BAYS)
        )
        return
    assert request["verb"] in set(Request)
    bays: Any = BAYS if request.get("bays") is None else request["bays"]
    strangers = [name for name in bays if name not in BAYS]
    assert not strangers or request["verb"] == Request.STOP, "only a stop is carried out beside an unknown name"
    known = [name for name in bays if name in BAYS]
    assert list(said["results"])[: len(set(known))] == list(dict.fromkeys(known))
    assert len(said["results"]) == len(set(known)) + bool(strangers)
    assert all(isinstance(answer, str) for answer in said["results"].values())


TOKEN = re.compile(rb'"(?:[^"\\]|\\.)*"|[\w.+-]+|\s+|.', re.DOTALL)
VERBS = ("status", *Request)


TARGET = Target(
    one,
    TOKEN.findall,
    kind_of_word,
    [
        *(json.dumps({"verb": verb, "bays": ["bay-1"]}).encode() + b"\n" for verb in VERBS),
        *(json.dumps({"verb": verb, "bays": ["bay-9", "bay-1", "x"]}).encode() + b"\n" for verb in VERBS),
        *(json.dumps({"verb": verb, "bay": "bay-2"}).encode() + b"\n" for verb in VERBS),
        b'{"verb": "stop"}\n', b"{}\n", b"[]\n", b'{"verb": "status", "bay": null}\n{"verb": "stop"}\n',
    ],
    [
        *(f'"{word}"'.encode() for word in ("verb", "bay", "bays", *BAYS, *VERBS)), b"null", b"true", b"NaN",
        b"-Infinity", b"1e999", b"-0", b"9" * 300, b'"\\ud800"', b'"\\u0000"', b'"\\n"', b'"\xf0\x9f\x94\x8b"', b'""',
        b"\n", b", ", b": ", b"{", b"}", b"[", b"]", b"[" * 1200, b"]" * 1200, b'{"a":' * 300, b"\xff", b"\xef\xbb\xbf",
        b"\0", b" " * 4096, b'"bay-1", ', b'"' + b"\\u0001" * 600 + b'"', b"\\", b'"',
    ],
    [f"orchestrator/service/{name}.py" for name in ("reception", "client", "control", "request_handler", "status")],
    max_bytes=client.MAX_REQUEST + 64,
    limit_s=1.0,
)  # fmt: skip
