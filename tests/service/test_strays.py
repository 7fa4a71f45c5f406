"""A charger in hand without a bay: stopped, verified by two replies, watched, then released."""

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

from orchestrator.core.persisted import Persisted
from orchestrator.devices.charger import ChargerPort
from orchestrator.errors import RequestError
from orchestrator.model import STOP, ChargerLink, ChargerReading, Command, ControlMode, Operation
from orchestrator.service.past import Entry, Place
from orchestrator.service.store import Store
from orchestrator.service.strays import WATCHED_S, Strays
from orchestrator.text.catalogue import say
from tests.core.said import into, raises
from tests.waiting import wait_until

LOST = Place("bay-1", "/dev/lost", "can0", 16)
READING = ChargerReading(
    0.0, 48.0, 0.0, control_mode=ControlMode.MANUAL, operation=Operation.STOPPED, current_step=0, charge_mode=None,
    precharge=None, connection=None,
)  # fmt: skip


class Port:
    """A charger port driven by hand."""

    def __init__(self) -> None:
        self.commands: list[Command | None] = []
        self.started = self.closed = False
        self.view: tuple[ChargerReading | None, ChargerLink] = (None, ChargerLink())

    def start(self) -> None:
        self.started = True

    def command(self, command: Command | None) -> None:
        self.commands.append(command)

    def close(self) -> None:
        self.closed = True


class Case:
    """One stray, and its view."""

    def __init__(self, directory: Path) -> None:
        self.now_s = 100.0
        self.port, self.said = Port(), list[str]()
        self.store = Store(directory, [Place("bay-2", "/dev/2", "can0", 17)], lambda: self.now_s, time.time)
        here = self.store._places[0]
        self.store._begin([Entry(here, Persisted(), 1), Entry(LOST, Persisted(running=True), 1)])
        self.strays = Strays(self.store, lambda _: cast("ChargerPort", self.port), into(self.said))
        self.strays.begin()

    def sees(
        self, *, runs: bool = False, stopped_s: float | None = None, amps: float = 0.0, online: bool = True
    ) -> bool:
        """A reply requested now, after a stop sent then; whether it counts as verified."""
        self.now_s += 0.2
        operation = Operation.RUNNING if runs else Operation.STOPPED
        link = ChargerLink(online=online, stop_sent_s=stopped_s)
        self.port.view = replace(READING, t_s=self.now_s, operation=operation, current_a=amps), link
        self.strays.look(self.now_s)
        return self.strays.unverified == []

    @property
    def running(self) -> bool:
        return self.store.past(LOST).running


@pytest.fixture(name="case")
def _case(tmp_path: Path) -> Iterator[Case]:
    yield Case(tmp_path)


def test_it_is_told_to_stop_and_people_are_told_of_it(case: Case) -> None:
    assert case.port.started
    assert case.port.commands == [STOP]
    assert [say(one) for one in case.strays.unverified] == ["bay-1 on /dev/lost"]
    assert case.said == [
        "bay-1 on /dev/lost: the station file has no bay on this port, but its charger may be running: stopping it"
    ]


def test_two_replies_after_a_stop_verify_it_and_its_bay_stays_held(case: Case) -> None:
    assert not case.sees(runs=True, amps=14.0)
    assert not case.sees(), "no stop was sent yet"
    stop_s = case.now_s + 0.1
    assert not case.sees(stopped_s=stop_s)
    assert not case.sees(stopped_s=stop_s)
    assert case.running
    assert case.sees(stopped_s=stop_s)
    assert not case.running
    assert say(case.store.past(LOST).hold) == ("the station file had no bay on /dev/lost while its charger was running")


def test_the_same_reply_twice_is_one(case: Case) -> None:
    case.sees(stopped_s=case.now_s)
    case.sees(stopped_s=case.now_s - 0.2)
    for _ in range(3):
        case.strays.look(case.now_s)
    assert case.strays.unverified


@pytest.mark.parametrize("seen", [{"runs": True}, {"amps": 14.0}])
def test_what_runs_on_is_not_verified(case: Case, seen: dict[str, float]) -> None:
    for _ in range(10):
        assert not case.sees(stopped_s=case.now_s, runs=bool(seen.get("runs")), amps=seen.get("amps", 0.0))
    assert case.running


def test_one_that_is_silent_is_not_verified(case: Case) -> None:
    for _ in range(10):
        assert not case.sees(stopped_s=case.now_s, online=False)


def verified(case: Case) -> None:
    while not case.sees(stopped_s=101.0 if case.now_s > 101 else None):
        assert case.now_s < 120


def test_one_that_runs_again_was_not_stopped(case: Case) -> None:
    verified(case)
    assert not case.sees(runs=True, amps=14.0, stopped_s=101.0)
    assert case.running
    assert case.said[-1] == "bay-1 on /dev/lost: its charger runs again: stopping it"
    assert not case.sees(stopped_s=101.0), "that stop was before"
    assert not case.sees(stopped_s=101.0)


def test_one_that_is_gone_for_good_is_dropped_when_a_person_says_so(case: Case) -> None:
    with raises(RequestError, match=r"no charger without a bay is waited for there \(waited for: /dev/lost\)"):
        case.strays.drop("/dev/2")
    case.sees(stopped_s=case.now_s)
    with raises(RequestError, match="its charger answers, so it is not gone"):
        case.strays.drop("/dev/lost")
    case.sees(online=False)
    what, revision = case.strays.drop("/dev/lost")
    assert what == "bay-1 on /dev/lost"
    assert (case.strays.unverified, case.strays.status(), case.running) == ([], [], False)
    assert say(case.store.past(LOST).hold).startswith("the station file had no bay on /dev/lost")
    assert revision == case.store._revision
    wait_until(lambda: case.port.closed, what="the port")


def test_its_port_is_given_back_after_a_while(case: Case) -> None:
    verified(case)
    began_s = case.now_s
    while not case.port.closed:
        case.sees(stopped_s=101.0)
        if case.now_s > began_s + WATCHED_S:
            wait_until(lambda: case.port.closed, what="the port")
    assert case.now_s >= began_s + WATCHED_S
    assert case.strays.unverified == []
    assert case.strays.status() == [
        {"bay": "bay-1", "port": "/dev/lost", "state": "HELD", "verified": True, "problem": "", "cause": None}
    ]  # fmt: skip
