"""The emulated charger on a real pty: the document's bytes, and the effect of each kind of line on them."""

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.model import ChargeMode, Operation
from orchestrator.sim.background import Background
from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.charger_frames import Kind
from orchestrator.sim.charger_wire import ChargerWire
from orchestrator.sim.line import BYTE_S, LINES, SimulatedLine
from tests.sim.wires import Port, framed
from tests.waiting import wait_until

POLL = "AF FA 90 05 01 90 03 04 2D AF A0"
REPLY = "AF FA 90 09 03 90 13 93 09 07 00 03 E5 AF A0"
STOP = "AF FA 90 04 10 90 00 34 AF A0"
RESUME = framed("90 04 10 90 01")
RUN = "AF FA 90 05 02 90 01 01 29 AF A0"
CHECKSUM_COMPLAINT = framed("90 07 1F 08 05 01 90 2E")


@contextlib.contextmanager
def charger_on(line: SimulatedLine, link: Path | None = None) -> Iterator[tuple[ChargerWire, Port, Background]]:
    charger = SimulatedCharger(voltage_v=50.11, current_a=23.11, mode=ChargeMode.PRECHARGE)
    with Background() as background:
        wire = ChargerWire(background.loop, charger, line=line, link=link)
        background.call(wire.open)
        port = Port(wire.path)
        try:
            yield wire, port, background
        finally:
            port.close()
            background.call(wire.close)


@pytest.mark.parametrize("name", ["perfect", "real", "bytewise", "delayed"])
def test_the_printed_request_gets_the_printed_reply(name: str) -> None:
    with charger_on(LINES[name]) as (_, port, _):
        assert port.ask(POLL, 15) == REPLY


def test_an_echoing_adapter_returns_the_request_first() -> None:
    with charger_on(LINES["echo"]) as (_, port, _):
        assert port.ask(POLL, 26) == f"{POLL} {REPLY}"


def test_the_lossy_line_loses_a_few_exchanges_and_recovers() -> None:
    with charger_on(LINES["lossy"]) as (wire, port, _):
        good = 0
        for _ in range(60):
            port.write(POLL)
            good += port.read(15, within_s=0.15).endswith(REPLY)
            port.read(64, within_s=0.0)
        assert 40 <= good < 60
        assert good <= wire.counters.polls < 60


def test_the_garbage_line_only_adds() -> None:
    with charger_on(LINES["garbage"]) as (wire, port, _):
        for _ in range(12):
            port.write(POLL)
            assert REPLY in port.read_until(REPLY)
        assert wire.counters.polls == 12


def test_a_request_in_pieces_is_one_request() -> None:
    with charger_on(LINES["perfect"]) as (_, port, _):
        port.write(POLL[:11])
        port.write(POLL[12:])
        assert port.read(15) == REPLY


def test_a_frame_that_is_cut_off_is_forgotten_after_a_pause() -> None:
    with charger_on(LINES["perfect"]) as (wire, port, _):
        port.write(POLL[:14])
        wait_until(lambda: wire.counters.bad == 1)
        assert port.ask(POLL, 15) == REPLY


def test_a_bad_frame_is_answered_with_what_was_received() -> None:
    with charger_on(LINES["perfect"]) as (wire, port, _):
        assert port.ask("AF FA 90 05 01 90 03 04 2E AF A0", 13) == CHECKSUM_COMPLAINT
        assert (wire.counters.bad, wire.counters.polls) == (1, 0)


def test_orders_are_obeyed_in_silence_and_counted() -> None:
    with charger_on(LINES["perfect"]) as (wire, port, _):
        heard = []
        wire.on_bytes = lambda _, data: heard.append(data)
        for order in (RESUME, RUN, STOP):
            port.write(order)
        wait_until(lambda: wire.counters.stops == 1)
        assert port.read(1, within_s=0.05) == ""
        assert (wire.counters.resumes, wire.counters.orders) == (1, 1)
        assert (wire.charger.run, wire.charger.operation) == (True, Operation.STOPPED)
        assert b"".join(heard) == bytes.fromhex(f"{RESUME} {RUN} {STOP}")


def test_the_first_stop_since_a_mark_has_its_time() -> None:
    with charger_on(LINES["real"]) as (wire, port, background):
        background.call(wire.counters.mark)
        before_s = time.monotonic()
        port.write(STOP)
        wait_until(lambda: wire.counters.first_stop_s is not None)
        first_s = wire.counters.first_stop_s
        port.write(STOP)
        wait_until(lambda: wire.counters.stops == 2)
        assert first_s is not None
        assert before_s <= first_s <= time.monotonic()
        assert wire.counters.first_stop_s == first_s == wire.counters.first_byte_s


def test_a_real_line_takes_the_time_of_its_bytes() -> None:
    with charger_on(LINES["real"]) as (_, port, _):
        began_s = time.monotonic()
        assert port.ask(POLL, 15) == REPLY
        assert time.monotonic() - began_s >= (11 + 15) * BYTE_S


def test_bytewise_answers_come_in_many_pieces() -> None:
    with charger_on(SimulatedLine(byte_s=0.004, bytewise=True)) as (_, port, _):
        port.write(POLL)
        sizes: list[int] = []
        while sum(sizes) < 15:
            sizes.append(len(os.read(port.fd, 64)))
        assert len(sizes) >= 5


@pytest.mark.parametrize("direction", ["mute_rx", "mute_tx"])
def test_a_mute_line_gives_no_answer(direction: str) -> None:
    with charger_on(LINES["perfect"]) as (wire, port, _):
        setattr(wire, direction, True)
        port.write(POLL)
        assert port.read(1, within_s=0.05) == ""
        wait_until(lambda: wire.counters.polls == (direction == "mute_tx"))
        setattr(wire, direction, False)
        assert port.ask(POLL, 15) == REPLY


def test_complaints_and_lies() -> None:
    with charger_on(LINES["perfect"]) as (wire, port, _):
        wire.lies[Kind.CHARGE_MODE] = 9
        assert port.ask(POLL, 15) == framed("90 09 03 90 13 93 09 07 00 09")
        wire.complains = True
        assert port.ask(POLL, 13) == framed("90 07 1F 08 05 01 90 2D")


def test_an_unplugged_port_comes_back_behind_the_same_name(tmp_path: Path) -> None:
    link = tmp_path / "bay-1"
    with charger_on(LINES["perfect"], link) as (wire, port, background):
        background.call(wire.close)
        assert not link.is_symlink()
        assert not wire.is_open
        assert os.read(port.fd, 1) == b"", "the line hangs up"
        background.call(wire.open)
        again = Port(str(link))
        assert again.ask(POLL, 15) == REPLY
        again.close()
