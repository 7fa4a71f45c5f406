"""One bay of the service with devices made by hand: orders, answers, and exceptions of our own code."""

import json
import time
from pathlib import Path
from typing import NoReturn

import pytest

from orchestrator.core.memory import Memory
from orchestrator.interlock import Grant
from orchestrator.model import (
    STOP,
    BatteryLink,
    BatteryReading,
    ChargerLink,
    ChargerReading,
    Command,
    Request,
    State,
)
from orchestrator.service import bay as bay_module
from orchestrator.service.bay import Asked, BayRunner
from orchestrator.service.journal import Journal
from orchestrator.service.kept import Kept
from tests.core.world import World, bay


class Devices:
    """A charger and a battery as a `World` has them, and every order that was left."""

    def __init__(self) -> None:
        self.world = World()
        self.orders: list[tuple[Command | None, Grant | None]] = []

    def order(self, command: Command | None, grant: Grant | None = None) -> None:
        self.orders.append((command, grant))

    @property
    def view(self) -> tuple[ChargerReading | None, ChargerLink]:
        snapshot = self.world.snapshot(None, "")
        return snapshot.charger, snapshot.charger_link


class Pack:
    def __init__(self, world: World) -> None:
        self.world = world

    @property
    def view(self) -> tuple[BatteryReading, BatteryLink]:
        snapshot = self.world.snapshot(None, "")
        return snapshot.battery, snapshot.battery_link


class Bench:
    """A bay that is not started by anybody else: the test is its control loop."""

    def __init__(self, directory: Path, memory: Memory | None = None) -> None:
        self.devices = Devices()
        self.journal = Journal(directory, 1.0, time.monotonic, time.time)
        self.bay = BayRunner(bay(), self.devices, Pack(self.devices.world), self.journal, memory or Memory())

    def step(self, count: int = 1) -> State:
        world = self.devices.world
        for _ in range(count):
            world.now_s += 0.2
            if self.bay.decision is not None:
                world.decisions = [self.bay.decision]
            world._obey()
            self.bay.run(world.now_s)
        assert self.bay.decision is not None
        return self.bay.decision.state

    def ask(self, request: Request) -> str:
        asked = Asked(request)
        self.bay.ask(asked)
        assert not asked.done.is_set()
        self.step()
        assert asked.done.is_set()
        return asked.answer

    @property
    def said(self) -> list[str]:
        return list(self.journal._said)


@pytest.fixture(name="bench")
def _bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def test_before_the_first_step_the_status_says_that_it_starts(bench: Bench) -> None:
    assert (bench.bay.status()["state"], bench.bay.verified) == ("STARTING", False)


def test_the_first_order_is_a_stop_and_every_later_one_has_its_evidence(bench: Bench) -> None:
    bench.step(30)
    assert bench.bay.status()["state"] == "CHARGING"
    (first, _), *others = bench.devices.orders
    assert first == STOP
    assert all(grant is not None for command, grant in others if command not in (None, STOP))
    assert all(grant is None for command, grant in others if command is None)


def test_it_is_verified_when_it_stands_by_and_nothing_is_ordered(bench: Bench) -> None:
    bench.step(30)
    assert not bench.bay.verified
    assert bench.ask(Request.STOP) == ""
    assert not bench.bay.verified
    bench.step(10)
    assert bench.bay.verified


def test_requests_are_answered_one_a_step_in_their_order(bench: Bench) -> None:
    bench.step(30)
    stop, pause = Asked(Request.STOP), Asked(Request.PAUSE)
    bench.bay.ask(stop)
    bench.bay.ask(pause)
    bench.step()
    assert (stop.done.is_set(), pause.done.is_set()) == (True, False)
    bench.step()
    assert (stop.answer, pause.answer) == ("", "not running: stopped by the operator; start to go on")


def test_every_change_of_state_is_said_once(bench: Bench) -> None:
    bench.step(30)
    assert [line.split(": ")[1] for line in bench.said] == [
        "STARTING",
        "STARTING → IDLE",
        "IDLE → QUALIFYING",
        "QUALIFYING → CHARGING",
    ]


def test_an_exception_of_our_own_stops_the_bay_latches_and_is_told(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> NoReturn:
        raise ZeroDivisionError("by accident")

    bench.step(30)
    with monkeypatch.context() as broken_world:
        broken_world.setattr(bay_module, "step", broken)
        assert "ZeroDivisionError('by accident') in broken, line" in bench.ask(Request.PAUSE)
        bench.step(5)
        assert {command for command, _ in bench.devices.orders[-6:]} == {STOP}
        status = bench.bay.status()
        assert (status["state"], status["alarm"]) == ("STOPPING", True)
        assert "internal error: ZeroDivisionError" in str(status["reason"])
        assert not bench.bay.verified
    assert sum("internal error" in line for line in bench.said) == 1
    bench.step(10)
    status = json.loads(json.dumps(bench.bay.status()))
    assert status["state"] == "TRIPPED"
    assert [fault["id"] for fault in status["faults"]] == ["internal"]
    assert bench.ask(Request.START).startswith("internal is latched and needs a reset")
    assert bench.ask(Request.RESET) == ""


def test_what_must_outlive_it_is_kept_whenever_it_changes(bench: Bench) -> None:
    bench.step(8)
    assert bench.journal._kept == {"bay-1": Kept()}
    bench.step(22)
    assert bench.journal._kept == {"bay-1": Kept(running=True)}
    bench.ask(Request.PAUSE)
    bench.step(10)
    assert bench.journal._kept == {"bay-1": Kept(paused=True)}
    bench.ask(Request.STOP)
    assert bench.journal._kept == {"bay-1": Kept(paused=True, hold="stopped by the operator; start to go on")}


def test_the_stop_at_the_end_is_no_operators(bench: Bench) -> None:
    bench.step(30)
    bench.bay.end()
    bench.step(10)
    assert bench.bay.verified
    assert bench.journal._kept == {"bay-1": Kept()}


def test_the_stop_at_the_end_does_not_undo_an_operators(bench: Bench) -> None:
    bench.step(30)
    bench.ask(Request.STOP)
    bench.bay.end()
    bench.step(10)
    assert bench.journal._kept == {"bay-1": Kept(hold="stopped by the operator; start to go on")}


def test_it_begins_with_what_was_kept(tmp_path: Path) -> None:
    bench = Bench(tmp_path, Kept(running=True).memory(999.0))
    assert bench.step(30) is State.IDLE
    assert [fault["id"] for fault in bench.bay.status()["faults"]] == ["found_running"]  # type: ignore[attr-defined]  # a JSON document
    assert bench.ask(Request.START) == ""
    assert bench.step(30) is State.CHARGING
