"""A bay's contactor in the service: when its line is taken, and what a failing line causes and reports."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.errors import LinkError
from orchestrator.model import STOP, Cause, Request, State
from orchestrator.service import bay as bay_module
from orchestrator.service.contactor import CLOSING_S, REOPEN_S, Contactor
from orchestrator.service.guarded import GuardedOutput
from orchestrator.text.catalogue import fields
from tests.core.said import cause, say
from tests.service.bench import Bench, fields_of

GONE = "/dev/gpiochip0 line 17: gone"


class Line:
    """A kernel line: driven by its holder, or by nobody."""

    def __init__(self) -> None:
        self.taken = 0  #: how often
        self.held = self.closed = False
        self.broken = False

    def take(self) -> "Line":
        if self.broken:
            raise LinkError(cause(GONE))
        assert not self.held
        self.held, self.closed, self.taken = True, False, self.taken + 1
        return self

    def drive(self, *, closed: bool) -> None:
        if self.broken:
            raise LinkError(cause(GONE))
        self.closed = closed

    def fileno(self) -> int:
        return 17

    def close(self) -> None:
        self.held = False


@pytest.fixture(name="line")
def _line() -> Line:
    return Line()


@pytest.fixture(name="contactor")
def _contactor(line: Line) -> Contactor:
    return Contactor(line.take)


@pytest.fixture(name="bench")
def _bench(tmp_path: Path, contactor: Contactor) -> Bench:
    return Bench(tmp_path, contactor=contactor)


def told(bench: Bench) -> list[dict[str, object]]:
    return [dict(fields_of(line)) for _, _, _, line in bench.journal._waiting[False] if line[0] == "contactor"]


# --- by itself -------------------------------------------------------------------------------------------------------


def test_a_reading_from_before_it_has_closed_proves_nothing(contactor: Contactor, tmp_path: Path) -> None:
    reading = replace(Bench(tmp_path).charger.reading, t_s=100.0)
    assert not contactor.connects(reading)
    contactor.drive(reading.t_s - CLOSING_S, closed=True)
    assert contactor.connects(reading)
    assert not contactor.connects(None)
    contactor.drive(reading.t_s, closed=False)
    contactor.drive(reading.t_s, closed=True)
    assert not contactor.connects(reading)


def test_since_when_it_is_closed_does_not_move(contactor: Contactor) -> None:
    for now_s in (1.0, 2.0, 3.0):
        contactor.drive(now_s, closed=True)
    assert contactor.closed_s == 1.0


def test_a_line_that_fails_is_given_back_and_taken_anew_every_second(contactor: Contactor, line: Line) -> None:
    contactor.drive(0.0, closed=True)
    line.broken = True
    contactor.drive(0.1, closed=True)
    assert (say(contactor.problem), contactor.closed_s, line.held) == (GONE, None, False)
    line.broken = False
    contactor.drive(0.0 + REOPEN_S, closed=True)
    assert (say(contactor.problem), line.taken) == (GONE, 1)
    contactor.drive(0.1 + REOPEN_S, closed=False)
    assert (say(contactor.problem), contactor.closed_s, line.taken) == ("", None, 2)


def test_at_the_end_it_is_opened_before_the_line_is_given_back(contactor: Contactor, line: Line) -> None:
    contactor.drive(0.0, closed=True)
    contactor.give_back()
    assert (line.closed, line.held, contactor.closed_s) == (False, False, None)
    contactor.give_back()


def test_the_guardian_has_it_for_as_long_as_it_is_held(line: Line) -> None:
    class Guardian:
        def __init__(self) -> None:
            self.told: list[tuple[str, int | None]] = []

        def hold_contactor(self, name: str, fd: int | None) -> None:
            self.told.append((name, fd))

    guardian = Guardian()
    output = GuardedOutput("bay-1", line.take, guardian)  # type: ignore[arg-type]  # both as the real ones
    assert guardian.told == [("bay-1", 17)]
    output.drive(closed=True)
    assert line.closed
    output.close()
    assert guardian.told == [("bay-1", 17), ("bay-1", None)]
    assert not line.held


# --- in a bay --------------------------------------------------------------------------------------------------------


def test_it_closes_when_standby_is_verified_and_opens_at_the_end(bench: Bench, line: Line) -> None:
    bench.step()
    assert bench.charger.commands[0][0] == STOP
    assert (line.taken, line.closed) == (1, False)
    bench.charging()
    assert line.closed
    bench.bay.end(Cause.of("signal", name="SIGTERM"))
    bench.step(10)
    assert bench.bay.verified
    bench.bay.isolate()
    assert (line.closed, line.held) == (False, False)
    assert told(bench) == [{"closed": closed, "problem": "", "cause": None} for closed in (False, True, False)]


def test_a_charger_that_does_not_obey_is_cut_off(bench: Bench, line: Line) -> None:
    bench.charging()
    bench.charger.deaf = True
    bench.ask(Request.STOP)
    assert line.closed
    bench.until(State.UNCONTROLLABLE)
    assert not line.closed
    status = json.loads(json.dumps(bench.bay.status()))
    assert (status["alarm"], status["contactor"]) == ("danger", {"closed": False, "problem": "", "cause": None})


def test_an_exception_of_our_own_that_stays_opens_it_once_the_stop_has_had_its_time(
    bench: Bench, line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError

    bench.charging()
    monkeypatch.setattr(bay_module, "decide", broken)
    bench.step()
    assert bench.charger.commands[-1][0] == STOP
    assert line.closed, "a charger that obeys is without current before it opens"
    bench.step(16)
    assert not line.closed


def test_a_line_that_fails_stops_the_charge_and_is_told(bench: Bench, line: Line) -> None:
    bench.charging()
    line.broken = True
    bench.step(2)
    status = json.loads(json.dumps(bench.bay.status()))
    assert [fault["id"] for fault in status["faults"]] == ["contactor_lost"]
    assert GONE in status["faults"][0]["text"]
    assert status["contactor"] == {"closed": False, "problem": GONE, "cause": fields(cause(GONE))}
    assert told(bench)[-1] == {"closed": False, "problem": GONE, "cause": fields(cause(GONE))}
    line.broken = False
    bench.step(round(2 * REOPEN_S / 0.2))
    assert bench.bay.status()["contactor"] == {"closed": True, "problem": "", "cause": None}
    bench.until(State.CHARGING, 300)


def test_a_bay_without_one_says_so(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.charging()
    assert bench.bay.status()["contactor"] is None
    assert told(bench) == []
