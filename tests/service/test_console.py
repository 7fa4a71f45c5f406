"""Console output on a real pipe whose reader is normal, slow, stopped or gone."""

import os
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import suppress

import pytest

from orchestrator.service.console import BACKLOG, Console
from tests.waiting import wait_until

Pipe = tuple[int, int]


@pytest.fixture(name="pipe")
def _pipe() -> Iterator[Pipe]:
    reader, writer = os.pipe()
    yield reader, writer
    for fd in (reader, writer):
        try:
            os.close(fd)
        except OSError:
            assert fd == reader, "a test may have closed it"


def test_what_is_said_comes_at_once_and_in_order(capfd: pytest.CaptureFixture[str]) -> None:
    console = Console()
    console.start()
    console.say("bay-1: 8.4 °C")
    console.say("two\nlines")
    console.say(os.fsdecode(b"/dev/\xff"))
    console.close()
    assert capfd.readouterr().err == "bay-1: 8.4 °C\ntwo\nlines\n/dev/\\udcff\n"


def fill(writer: int) -> None:
    """Nothing more fits in, so that whoever writes next waits."""
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writer, b"\n")
    os.set_blocking(writer, True)


def test_a_reader_that_stands_still_delays_nobody_and_learns_what_it_missed(pipe: Pipe) -> None:
    reader, writer = pipe
    fill(writer)
    console = Console(writer)
    console.start()
    console.say(f"{0:0200}")
    wait_until(lambda: not console._said, what="the writer")
    began_s = time.monotonic()
    for number in range(1, 3 * BACKLOG):
        console.say(f"{number:0200}")
    assert time.monotonic() - began_s < 1
    began_s = time.monotonic()
    console.close(0.2)
    assert time.monotonic() - began_s < 1
    text = b""
    while f"{3 * BACKLOG - 1:0200}\n".encode() not in text:
        text += os.read(reader, 1 << 16)
    first, told, *others = text.decode().strip().splitlines()
    assert int(first) == 0
    assert told == f"({2 * BACKLOG - 1} lines are left out here: nobody has read them in time)"
    assert [int(line) for line in others] == list(range(2 * BACKLOG, 3 * BACKLOG))


def test_a_standard_error_that_is_gone_stops_nothing(pipe: Pipe) -> None:
    reader, writer = pipe
    os.close(reader)
    console = Console(writer)
    console.start()
    console.say("nobody hears")
    wait_until(lambda: not console._said, what="the writer")
    console.close()
    assert not console._thread.is_alive()


def test_one_that_takes_nothing_right_now_is_waited_for(pipe: Pipe) -> None:
    reader, writer = pipe
    os.set_blocking(writer, False)
    while True:
        try:
            os.write(writer, b"x" * 65536)
        except BlockingIOError:
            break
    console = Console(writer)
    console.start()
    console.say("last")
    text = b""
    while not text.endswith(b"last\n"):
        text += os.read(reader, 1 << 16)
    console.close()
    assert not console._thread.is_alive()


def test_a_service_that_was_started_without_it_writes_into_nothing_else(
    pipe: Pipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its number may by then belong to a charger's port."""
    reader, writer = pipe
    monkeypatch.setattr(sys, "__stderr__", None)
    console = Console(writer)
    console.start()
    console.say("bay-1: IDLE")
    console.close()
    os.set_blocking(reader, False)
    with pytest.raises(BlockingIOError):
        os.read(reader, 1)


def test_whoever_prints_waits_for_no_reader_either(pipe: Pipe) -> None:
    """A traceback from a library's thread, for example."""
    reader, writer = pipe
    before = sys.stderr
    console = Console(writer)
    console.start()
    try:
        raise ValueError("by accident")
    except ValueError:
        traceback.print_exc()
    sys.stderr.write("no end yet")
    sys.stderr.write(", now\n")
    console.close()
    assert sys.stderr is before
    text = os.read(reader, 1 << 16).decode()
    assert "ValueError: by accident\n" in text
    assert text.endswith("no end yet, now\n")
