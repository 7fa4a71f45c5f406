"""One bay of the service with hand-made devices: commands, answers, and internal errors."""

import json
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import pytest

from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory, with_values
from orchestrator.core.persisted import Persisted
from orchestrator.core.rules import Rules
from orchestrator.model import STOP, Alarm, Cause, Decision, Request, Snapshot, State
from orchestrator.model.cause import from_plain
from orchestrator.service import bay as bay_module
from orchestrator.service.asked import Asked
from orchestrator.text.catalogue import say
from tests.service.bench import STEP_S, Bench, fields_of

HELD = "stopped by the operator"


@pytest.fixture(name="bench")
def _bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def said(bench: Bench) -> list[str]:
    return bench.said


def decisions(bench: Bench) -> int:
    return sum(kind == "decision" for _, _, _, (kind, _) in bench.journal._waiting[False])


def test_before_the_first_step_the_status_says_that_it_starts(bench: Bench) -> None:
    assert (bench.bay.status()["state"], bench.bay.verified) == ("STARTING", False)


def test_the_first_order_is_a_stop_and_every_later_one_has_its_evidence(bench: Bench) -> None:
    bench.charging()
    (first, _), *others = bench.charger.commands
    assert first == STOP
    assert all(grant is not None for command, grant in others if command not in (None, STOP))
    assert all(grant is None for command, grant in others if command is None)


def test_the_rule_that_limits_the_current_is_told_with_the_present_value(bench: Bench) -> None:
    bench.battery.values["soc_pct"] = 90.0
    bench.charging()
    written = decisions(bench)
    for soc_pct in (93.0, 96.0):
        bench.battery.values["soc_pct"] = soc_pct
        bench.step(10)
        status = bench.bay.status()
        assert f"SOC {soc_pct:.0f} % in 90 … 100 allows 8.0 A" in str(status["reason"])
        assert f"SOC {soc_pct:.0f} % in 90 … 100 allows 8.0 A" in str(status["step_rule"])
    assert decisions(bench) == written, "the decision is the same"
    bench.battery.values["soc_pct"] = 85.0
    bench.step(4)
    assert "SOC 85 % has left 90 … 100, which allows 8.0 A" in str(bench.bay.status()["step_rule"]), "not raised yet"


def test_it_is_verified_when_it_stands_by_and_nothing_is_ordered(bench: Bench) -> None:
    bench.charging()
    assert not bench.bay.verified
    assert bench.ask(Request.STOP) == ""
    assert not bench.bay.verified
    bench.step(10)
    assert bench.bay.verified


def test_the_bmu_is_watched_closely_from_qualifying_until_the_charger_is_verified(bench: Bench) -> None:
    bench.battery.values["soc_pct"] = 99.0  # not worth a charge
    bench.until(State.IDLE)
    assert bench.battery.attended == [False]  # until then it was, as nobody knew better
    bench.battery.values["soc_pct"] = 50.0
    bench.until(State.QUALIFYING)
    assert bench.battery.attended == [False, True]
    bench.charging()
    bench.ask(Request.STOP)
    assert bench.battery.attended == [False, True]
    bench.until(State.HELD)
    assert bench.battery.attended == [False, True, False]


def test_before_its_first_decision_a_bay_may_be_in_danger(bench: Bench) -> None:
    """What was persisted has not been applied yet: the charger may still be running."""
    assert bench.bay.decision is None
    assert (bench.bay.alarm, bench.bay.status()["alarm"]) == (Alarm.DANGER, "danger")
    bench.step()
    assert (bench.bay.alarm, bench.bay.status()["alarm"]) == (Alarm.NONE, "none")


def test_requests_are_answered_one_a_step_in_their_order(bench: Bench) -> None:
    bench.charging()
    stop, pause = Asked(Request.STOP), Asked(Request.PAUSE)
    bench.bay.ask(stop)
    bench.bay.ask(pause)
    bench.step()
    assert (stop.done.is_set(), pause.done.is_set()) == (True, False)
    bench.step()
    assert (say(stop.answer), say(pause.answer)) == ("", f"not running: {HELD}")


def test_a_stop_waits_for_nothing_and_what_it_overtook_is_refused(bench: Bench) -> None:
    """However many requests precede it, and however often it is repeated: the next decision does it."""
    bench.charging()
    early = [Asked(Request.PAUSE), *(Asked(Request.START) for _ in range(5))]
    stops, late = [Asked(Request.STOP), Asked(Request.STOP)], Asked(Request.PAUSE)
    for one in (*early, *stops, late):
        bench.bay.ask(one)
    bench.step()
    assert [one.done.is_set() for one in (*early, *stops, late)] == [True] * 8 + [False]
    assert {say(one.answer) for one in early} == {"a stop came meanwhile: ask again if it is still wanted"}
    assert {one.answer for one in stops} == {None}
    bench.step()
    assert say(late.answer) == "not running: stopped by the operator"


def test_every_change_of_state_is_said_once(bench: Bench) -> None:
    bench.charging()
    assert [line.split(": ")[1] for line in said(bench)] == [
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

    bench.charging()
    with monkeypatch.context() as broken_world:
        broken_world.setattr(bay_module, "decide", broken)
        assert "ZeroDivisionError('by accident') in broken, line" in bench.ask(Request.PAUSE)
        bench.step(5)
        assert {command for command, _ in bench.charger.commands[-6:]} == {STOP}
        status = bench.bay.status()
        assert (status["state"], status["alarm"]) == ("STOPPING", "none")
        assert "internal: ZeroDivisionError" in str(status["reason"])
        bench.step(12)
        status = bench.bay.status()
        assert (status["state"], status["alarm"]) == ("UNCONTROLLABLE", "danger")
        assert str(status["reason"]).startswith("CUT THE MAINS")
        assert not bench.bay.verified
    assert sum("internal error" in line for line in said(bench)) == 1
    bench.step(70)
    status = json.loads(json.dumps(bench.bay.status()))
    assert status["state"] == "TRIPPED"
    assert [fault["id"] for fault in status["faults"]] == ["internal"]
    assert bench.ask(Request.START).startswith("internal: start is refused before a reset: ")
    assert bench.ask(Request.RESET) == ""


def kept(bench: Bench) -> tuple[bool, str, bool]:
    """The bay's state on disk: running, hold, paused."""
    (entry,) = json.loads(bench.store.path.read_text(encoding="utf-8"))["entries"]
    return entry["running"], say(from_plain(entry["hold"])) if entry["hold"] else "", entry["paused"]


def test_what_must_outlive_it_is_kept_whenever_it_changes(bench: Bench) -> None:
    bench.until(State.IDLE)
    assert kept(bench) == (False, "", False)
    bench.charging()
    assert kept(bench) == (True, "", False)
    bench.ask(Request.PAUSE)
    bench.step(10)
    assert kept(bench) == (False, "", True)
    bench.ask(Request.STOP)
    assert kept(bench) == (False, HELD, True)


def test_a_request_is_answered_when_its_effect_is_on_the_disk(bench: Bench) -> None:
    bench.charging()
    bench.disk = False
    stop = Asked(Request.STOP)
    bench.bay.ask(stop)
    bench.step(5)
    assert not stop.done.is_set()
    bench.store.turn()
    bench.disk = True
    bench.step()
    assert (stop.done.is_set(), stop.answer) == (True, None)
    assert kept(bench)[1] == HELD


def test_a_request_that_no_disk_takes_is_answered_with_that(bench: Bench) -> None:
    bench.charging()
    bench.disk = False
    stop = Asked(Request.STOP)
    bench.bay.ask(stop)
    bench.step(12)
    assert stop.done.is_set()
    assert say(stop.answer).startswith("done, but not saved: a restart would forget what changes: ")
    assert bench.charger.reading.current_a == 0


def test_a_start_that_no_disk_takes_is_answered_no_and_starts_nothing_later(bench: Bench) -> None:
    bench.until(State.CHARGING)
    bench.ask(Request.STOP)
    bench.disk = False
    start = Asked(Request.START)
    bench.bay.ask(start)
    bench.step(12)
    assert start.done.is_set()
    assert say(start.answer).startswith("not done: a restart would forget what changes: ")
    again = Asked(Request.START)
    bench.bay.ask(again)
    bench.step()
    assert say(again.answer).startswith("not done: a restart would forget what changes: ")
    bench.disk = True
    assert bench.step(100) is State.HELD, "the disk is well again, and nobody has started it since"
    assert kept(bench)[1] == HELD
    assert bench.ask(Request.START) == ""
    bench.until(State.CHARGING)


def test_a_refusal_waits_for_no_disk(bench: Bench) -> None:
    bench.ask(Request.STOP)
    bench.disk = False
    pause = Asked(Request.PAUSE)
    bench.bay.ask(pause)
    bench.step()
    assert (pause.done.is_set(), say(pause.answer)) == (True, f"not running: {HELD}")


def test_whoever_decides_is_told_whether_running_is_on_the_disk(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """A charge intended by the core begins only once that is persisted; a write under way does not count."""
    told: list[bool] = []

    def intending(now_s: float, snapshot: Snapshot, memory: Memory, rules: Rules) -> tuple[Decision, Memory]:
        told.append(snapshot.running_persisted)
        decision, after = decide(now_s, snapshot, memory, rules)
        return replace(decision, command=None), with_values(after, intends=True)

    bench.step(3)
    monkeypatch.setattr(bay_module, "decide", intending)
    bench.disk = False
    bench.step(3)
    bench.disk = True
    bench.step(2)
    assert told == [False, False, False, False, True]


def test_the_stop_at_the_end_is_no_operators(bench: Bench) -> None:
    bench.charging()
    bench.bay.end(Cause.of("signal", name="SIGTERM"))
    bench.step()
    assert bench.bay.status()["reason"] == "the service ends: SIGTERM"
    bench.step(10)
    assert bench.bay.verified
    assert kept(bench) == (False, "", False)
    ended = [
        line
        for _, _, _, line in bench.journal._waiting[False]
        if line[0] == "session" and dict(fields_of(line))["result"]
    ]
    assert ended == [], "the charge goes on with the next run"


def test_what_was_charging_when_the_guardian_died_waits_for_an_operator(bench: Bench) -> None:
    bench.charging()
    bench.bay.end(Cause("guardian_died"), orderly=False)
    bench.step(10)
    assert bench.bay.verified
    hold = "the last run ended in mid-charge: the guardian has died"
    assert kept(bench) == (False, hold, False)


def test_what_was_not_charging_when_the_guardian_died_waits_for_nobody(bench: Bench) -> None:
    bench.until(State.QUALIFYING)
    bench.bay.end(Cause("guardian_died"), orderly=False)
    bench.step(10)
    assert kept(bench) == (False, "", False)


@pytest.mark.parametrize("before", [True, False])
def test_the_end_of_the_service_and_an_operators_stop_are_two_things(bench: Bench, *, before: bool) -> None:
    """The stop may come before the end or, in the same second, after it: the next run obeys it."""
    bench.charging()
    if before:
        bench.ask(Request.STOP)
    bench.bay.end(Cause.of("signal", name="SIGTERM"))
    bench.step()
    if not before:
        assert bench.ask(Request.STOP) == ""
    bench.step(10)
    assert kept(bench) == (False, HELD, False)


@pytest.mark.parametrize("steps", range(4))
def test_an_end_during_the_start_leaves_no_hold_behind(bench: Bench, steps: int) -> None:
    if steps:
        bench.step(steps)
    bench.bay.end(Cause.of("signal", name="SIGTERM"))
    bench.step(10)
    assert bench.bay.verified
    assert kept(bench) == (False, "", False)


def test_it_begins_with_what_was_kept(tmp_path: Path) -> None:
    bench = Bench(tmp_path, Persisted(running=True))
    assert bench.step(30) is State.HELD
    assert [fault["id"] for fault in bench.bay.status()["faults"]] == ["found_running"]
    assert bench.ask(Request.START) == ""
    bench.until(State.CHARGING)


# --- the machine under it ---------------------------------------------------------------------------------------------


def faults(bench: Bench) -> dict[str, str]:
    return {fault["id"]: fault["text"] for fault in bench.bay.status()["faults"]}


@pytest.mark.parametrize(("missed_s", "said"), [(0.8, set()), (1.0, {"late"}), (1.6, {"late", "overrun"})])
def test_a_step_that_comes_late_is_said_and_a_long_gap_stops(bench: Bench, missed_s: float, said: set[str]) -> None:
    bench.charging()
    bench.now_s += missed_s - STEP_S
    bench.step()
    assert set(faults(bench)) == said
    assert (bench.bay.status()["state"] == "STOPPING") is ("overrun" in said)


def test_a_machine_that_was_suspended_stops_and_qualifies_anew(bench: Bench) -> None:
    bench.asleep_s = 100.0  # before this service was started
    bench.charging()
    assert not faults(bench)
    bench.asleep_s += 1.9
    bench.step()
    assert not faults(bench)
    bench.asleep_s += 2.5
    assert bench.step() is State.STOPPING
    assert "suspended for 2 s" in faults(bench)["suspended"]
    bench.until(State.SUSPENDED)
    bench.until(State.QUALIFYING, 150)


def test_nothing_begins_while_a_latched_fault_would_be_forgotten(bench: Bench) -> None:
    fresh = bench.store.path.with_name("persisted.json.new")
    fresh.symlink_to("/dev/full")
    bench.step(50)
    assert bench.bay.status()["state"] == "SUSPENDED"
    why = f"a restart would forget what changes: {bench.store.path}: No space left on device; "
    assert faults(bench)["not_persisted"].startswith(why)
    fresh.unlink()
    bench.until(State.CHARGING)
    fresh.symlink_to("/dev/full")
    bench.step(50)
    assert bench.bay.status()["state"] == "CHARGING"
