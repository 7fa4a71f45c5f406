"""Valid and invalid requests at the control socket."""

import json
import socket
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.errors import RequestError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.service.client import MAX_REQUEST, parse_request
from orchestrator.service.reception import refused
from tests.service.control_bench import client, reply


@pytest.mark.parametrize(
    "line",
    [b"\n", b"status\n", b"[]\n", b'"status"\n', b"\xff\xfe\n", b"{\n", b"[" * 4000 + b"\n", b"\0" * 100 + b"\n"],
)
def test_what_is_no_request_is_told_so(path: Path, line: bytes) -> None:
    with client(path) as connection:
        connection.sendall(line)
        assert reply(connection) == refused(Cause("request_no_object"), "en")
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


@given(st.binary(max_size=200))
def test_any_bytes_are_a_request_or_refused(line: bytes) -> None:
    with suppress(RequestError):
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
    with pytest.raises(RequestError):
        parse_request(json.dumps(value).encode())
