"""Who writes what and when in a stop of last resort: threads, rounds, and turns where too few ports can be open."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from orchestrator.lastresort.contactors import Contactors
from orchestrator.lastresort.descriptors import Turns
from orchestrator.lastresort.lastline import AGAIN_S, ASK_S, ROUND_S, SILENT, STOPS, LastLine
from orchestrator.lastresort.lastport import ANSWER_S, GATHER_S, LastPort
from orchestrator.lastresort.laststop import LastStop, nobody, stop_all
from orchestrator.protocol.standby import OPERATION_STOP_FRAME, STOP_FRAME
from tests.guardian.chargers import running_chargers
from tests.link.ptys import plugged
from tests.link.strangers import holding
from tests.waiting import wait_until


@dataclass
class Use:
    """One use of a port: what, and from when to when."""

    what: Any
    began_s: float
    end_s: float = 0.0


@dataclass
class Uses:
    """What is done with each port, in order; all of it really happens."""

    of: dict[str, list[Use]] = field(default_factory=dict)
    open_at_once: int = 0

    def turns(self, port: str) -> list[list[Use]]:
        """The uses between one closing of the port and the next; its last one is the closing."""
        turns: list[list[Use]] = [[]]
        for use in list(self.of.get(port, ())):
            turns[-1].append(use)
            if use.what == "close":
                turns.append([])
        return turns[:-1]


@pytest.fixture
def uses(monkeypatch: pytest.MonkeyPatch) -> Uses:
    seen, is_open, lock = Uses(), set[str](), threading.Lock()

    def noting(name: str) -> None:
        real: Callable[..., Any] = getattr(LastPort, name)

        def used(port: LastPort, *args: Any) -> Any:
            use = Use(args[0] if args else name, time.monotonic())
            seen.of.setdefault(port.name, []).append(use)
            with lock:
                is_open.discard(port.name) if name == "close" else is_open.add(port.name)
                seen.open_at_once = max(seen.open_at_once, len(is_open))
            try:
                return real(port, *args)
            finally:
                use.end_s = time.monotonic()

        monkeypatch.setattr(LastPort, name, used)

    for name in ("write", "ask", "close"):
        noting(name)
    return seen


# --- turns ------------------------------------------------------------------------------------------------------------


def test_the_first_turn_stops_and_the_next_ones_ask(tmp_path: Path, uses: Uses) -> None:
    with running_chargers(tmp_path, 2) as benches:
        stopping = LastStop(leave_held=False, turns=Turns(1))
        stopping.stop({bench.name: None for bench in benches})
        assert stopping.finish(3 * ROUND_S) == {bench.name: "" for bench in benches}
    assert uses.open_at_once == 1
    for bench in benches:
        first, second, *_ = uses.turns(bench.name)
        assert [use.what for use in first] == [STOP_FRAME, STOP_FRAME, OPERATION_STOP_FRAME, "close"]
        again, operation, closed = (use.began_s - first[0].end_s for use in first[1:])
        assert (again >= STOPS[1][0], operation >= STOPS[2][0]) == (True, True)
        assert closed >= STOPS[2][0] + GATHER_S, "what was written last is on the wire"
        assert [use.what for use in second[:2]] == [STOP_FRAME, "ask"]
        assert second[1].began_s - second[0].end_s >= GATHER_S, "the stop is off the wire before the question"
        asked = [use for use in second if use.what == "ask"]
        if len(asked) > 1:
            assert asked[1].began_s - asked[0].end_s >= AGAIN_S - 0.001
            assert second[-1].began_s - asked[1].end_s < 3 * AGAIN_S, "a proof makes room for others"


def test_a_silent_charger_gives_its_turn_away_after_each_question(tmp_path: Path, uses: Uses) -> None:
    with plugged(tmp_path / "a") as silent, plugged(tmp_path / "b") as other:
        stopping = LastStop(leave_held=False, turns=Turns(1))
        stopping.stop({silent.path: None, other.path: None})
        assert stopping.finish(ROUND_S) == {silent.path: SILENT, other.path: SILENT}
    _first, *later = uses.turns(silent.path)
    assert later
    assert all([use.what for use in turn].count("ask") <= 1 for turn in later)


def test_ports_that_come_later_count_as_well() -> None:
    turns = Turns(1)
    stopping = LastStop(turns=turns)
    stopping.stop({"/nowhere/1": None})
    stopping.stop({"/nowhere/2": None})
    assert turns.ports == 2
    assert turns.crowded
    stopping.finish(0.0)


# --- threads ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[threading.Thread]:
    """Every thread that is started."""
    threads, start = list[threading.Thread](), threading.Thread.start

    def noting(thread: threading.Thread) -> None:
        threads.append(thread)
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", noting)
    return threads


def test_no_thread_that_hangs_keeps_the_process_from_ending(tmp_path: Path, started: list[threading.Thread]) -> None:
    with running_chargers(tmp_path) as (bench,):
        before = len(started)
        assert stop_all({bench.name: bench.duplicate()}, 3.0) == {bench.name: ""}
        contactors = Contactors()
        contactors.open("bay-1", lambda: "open")
        wait_until(lambda: contactors.became["bay-1"] == "open")
        ours = started[before:]
        assert f"stop {bench.name}" in [thread.name for thread in ours]
        assert len(ours) >= 3
        assert all(thread.daemon for thread in ours)


def test_open_ports_get_their_first_stop_before_they_have_a_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One after another, which takes a tenth of the time of as many threads."""
    tried, start = dict[str, bool](), LastLine.start

    def noting(line: LastLine) -> bool:
        tried[line.name] = line.tried.is_set()
        return start(line)

    monkeypatch.setattr(LastLine, "start", noting)
    monkeypatch.setattr("orchestrator.lastresort.laststop.STUCK_S", 1.0)  # a busy machine is no driver that hangs
    with running_chargers(tmp_path, 8) as benches:
        told = stop_all({bench.name: bench.duplicate() for bench in benches}, 3.0)
        assert told == {bench.name: "" for bench in benches}
        assert tried == {bench.name: True for bench in benches}


def test_whoever_got_no_thread_at_first_gets_one_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none_left(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    with running_chargers(tmp_path, 2) as benches:
        stopping = LastStop()
        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, "start", none_left)
            for bench in benches:
                stopping.stop({bench.name: None})
        assert stopping.finish(3.0) == {bench.name: "" for bench in benches}


# --- rounds -----------------------------------------------------------------------------------------------------------


def test_each_part_of_a_round_has_its_time(tmp_path: Path) -> None:
    stopped, asked = list[float](), list[float]()
    with plugged(tmp_path / "silent") as pty:
        began_s = time.monotonic()
        told = stop_all(
            {pty.path: None}, ROUND_S, on_stop=lambda: stopped.append(time.monotonic()),
            on_round=lambda: asked.append(time.monotonic()),
        )  # fmt: skip
    assert told == {pty.path: SILENT}
    assert (len(stopped), len(asked)) == (1, 1)
    assert stopped[0] - began_s >= STOPS[-1][0], "all frames of the stop are out"
    assert asked[0] - began_s >= ASK_S + ANSWER_S, "a silent charger has had time to answer"


def test_who_is_in_a_hurry_waits_for_the_stops_alone(tmp_path: Path) -> None:
    asked = list[float]()
    with plugged(tmp_path / "silent") as pty:
        stopping = LastStop()
        stopping.hurried = True
        began_s = time.monotonic()
        stopping.stop({pty.path: None})
        assert stopping.finish(20.0, on_round=lambda: asked.append(time.monotonic())) == {pty.path: SILENT}
        assert time.monotonic() - began_s < 10
        assert pty.drain().startswith(STOP_FRAME)
    assert asked[0] - began_s >= ASK_S, "the charger had time to obey"


# --- ports ------------------------------------------------------------------------------------------------------------


def test_a_port_that_is_not_open_takes_nothing_and_has_no_trouble_yet() -> None:
    port = LastPort("/nowhere", None, leave_held=False)
    assert port.trouble == ""
    assert not port.write(STOP_FRAME)
    assert LastLine("/nowhere", None, nobody, leave_held=False).why == SILENT


def test_a_port_of_another_orchestrator_is_stopped_where_nobody_else_may_be_relied_on(tmp_path: Path) -> None:
    with running_chargers(tmp_path) as (bench,), holding(bench.name, name="/opt/bin/orchestrator"):
        assert stop_all({bench.name: None}, 3.0, leave_held=False) == {bench.name: ""}
        assert not bench.runs
