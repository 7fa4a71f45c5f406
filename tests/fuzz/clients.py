"""The control socket itself, with a crowd of clients: half-sent requests, no reading, leaving, or staying.

After each story an honest client asks for the status and must get an answer.
"""

import json
import socket
from contextlib import ExitStack, suppress
from itertools import islice
from pathlib import Path
from time import monotonic
from typing import Any
from unittest.mock import patch

from orchestrator.errors import ServiceError
from orchestrator.lastresort import asking
from orchestrator.model import Request
from orchestrator.service import client, control, reception
from tests.fuzz.control import BAYS, LOOP, SUPERVISOR
from tests.fuzz.target import Target, cut_records, kind_of_record, record, records, scratch
from tests.waiting import wait_until

#: Events: another client, bytes from it, a whole request, a half-close, a close, a read of its answer,
#: another client's turn, and an honest client in between.
COME, SAY, ASK, END_WORDS, LEAVE, HEAR, TURN, HONEST = range(8)
REQUESTS = [json.dumps({"verb": verb}).encode() + b"\n" for verb in ("status", *Request)]
LONG = b'{"verb": "' + b"x" * client.MAX_REQUEST  # longer than a request may be, and without an end
MAX_CLIENTS = 8
MAX_EVENTS = 24
CLIENT_S = 0.005  #: instead of 1 s: how long each of these can delay the others
ANSWER_S = 60.0  #: for an honest client, on a machine that may stall


def _handle(request: dict[str, object]) -> reception.Answer | reception.Later:
    LOOP.stepped.clear()
    return SUPERVISOR._sockets.handler.answer(request)


PATH = scratch() / "control.sock"
SOCKET = control.ControlSocket(PATH, _handle, monotonic)  # type: ignore[arg-type]  # parse_request makes a dict
SOCKET.start()


class Crowd:
    """Several clients, acting in turn."""

    def __init__(self, end: ExitStack) -> None:
        self._end = end
        self._clients: list[socket.socket] = []

    def event(self, kind: int, content: bytes) -> None:
        """One client's next action; what the service refuses is skipped."""
        if kind == HONEST:
            is_answered()
        elif kind == COME or not self._clients:
            self._come()
        elif kind == TURN:
            self._clients.insert(0, self._clients.pop())
        else:
            with suppress(OSError):
                self._act(self._clients[-1], kind, content)
            if kind == LEAVE:
                self._clients.pop().close()

    def _come(self) -> None:
        if len(self._clients) < MAX_CLIENTS:
            client = self._end.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            client.connect(str(PATH))
            client.setblocking(False)
            self._clients.append(client)

    def _act(self, client: socket.socket, kind: int, content: bytes) -> None:
        if kind == SAY:
            client.send(content or LONG)
        elif kind == ASK:
            client.send(REQUESTS[content[0] % len(REQUESTS)] if content else REQUESTS[0] * 2)
        elif kind == END_WORDS:
            client.shutdown(socket.SHUT_RD if content else socket.SHUT_WR)
        elif kind == HEAR and (heard := client.recv(len(content) or 1 << 16)):
            assert heard.isascii()


def is_answered() -> None:
    """A proper request is answered for every bay; retried if the machine is too slow for the short deadlines here."""
    end_s = monotonic() + ANSWER_S
    while True:
        try:
            said: Any = asking.ask(PATH, {"verb": "status"}, timeout_s=ANSWER_S)
        except ServiceError:
            assert monotonic() < end_s and not SOCKET.stalled(monotonic()), "nobody answers any more"
        else:
            assert [bay["name"] for bay in said["bays"]] == list(BAYS)
            return


def one(data: bytes) -> None:
    """One story with a crowd."""
    before = _descriptors()
    with patch.object(client, "CLIENT_S", CLIENT_S):
        with ExitStack() as end:
            crowd = Crowd(end)
            for kind, content in islice(records(data), MAX_EVENTS):
                crowd.event(kind, content)
            is_answered()
        is_answered()
    wait_until(lambda: _descriptors() <= before, what="the end of the last client", every_s=0.001)


def _descriptors() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


_GOOD = record(COME) + record(ASK, b"\0") + record(HEAR)

TARGET = Target(
    one,
    cut_records,
    kind_of_record,
    [
        _GOOD + record(LEAVE),
        record(COME) + record(SAY, b'{"verb": ') + record(COME) + record(ASK, b"\3") + record(LEAVE) + record(HONEST),
        record(COME) + record(SAY) + record(END_WORDS) + record(COME) + record(END_WORDS) + record(TURN),
    ],
    [
        record(COME), record(SAY), record(SAY, b"\n"), record(SAY, b"{}\n"), record(SAY, b'{"verb": "stop"'),
        record(SAY, b"\xff\xfe\0"), record(ASK), *(record(ASK, bytes((number,))) for number in range(len(REQUESTS))),
        record(END_WORDS), record(END_WORDS, b"r"), record(LEAVE), record(HEAR), record(HEAR, b"1"), record(TURN),
        record(HONEST), _GOOD, record(COME) * 8,
    ],
    [f"orchestrator/service/{name}.py" for name in ("reception", "client", "control")],
    max_bytes=120,
    limit_s=2.0,
)  # fmt: skip
