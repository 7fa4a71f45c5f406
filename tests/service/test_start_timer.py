"""A start at a time of day: noted, kept, made by the wall clock, cancelled or refused; and which time is meant."""

import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.core.persisted import Persisted, PersistedFault
from orchestrator.errors import RequestError
from orchestrator.model import Cause, Request, State
from orchestrator.service import bay as bay_module
from orchestrator.service.asked import Asked
from orchestrator.service.asker import Asker
from orchestrator.service.instant import instant
from orchestrator.service.past import Place
from orchestrator.service.terms import START_WITH, Terms
from orchestrator.text.catalogue import say
from tests.service.bench import Bench, fields_of, the_bay

#: 18:10 here, on a day without a change of the clock.
ASKED_S = datetime.fromisoformat("2026-11-28T18:10").timestamp()
AT_S = datetime.fromisoformat("2026-11-28T22:00").timestamp()
KIM = Asker(behind="kim", uid=0, unix_s=ASKED_S)
LEE = Asker(behind="lee", uid=0, unix_s=ASKED_S)


class Wall:
    """The wall clock, which a test sets."""

    def __init__(self) -> None:
        self.now_s = ASKED_S

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture(name="wall")
def _wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    wall = Wall()
    monkeypatch.setattr(bay_module, "time", wall)
    return wall


def asks(bench: Bench, asked: Asked) -> str:
    bench.bay.ask(asked)
    bench.step()
    assert asked.done.is_set()
    return say(asked.answer)


def held(directory: Path, target_pct: float | None = None) -> Bench:
    """A bay that kim has stopped, and shall start at 22:00."""
    bench = Bench(directory)
    bench.charging()
    asks(bench, Asked(Request.STOP, KIM))
    bench.until(State.HELD)
    assert asks(bench, Asked(Request.START, KIM, start_unix_s=AT_S, target_pct=target_pct)) == ""
    return bench


def told(bench: Bench) -> str:
    timed = bench.bay.status()["timed_start"]
    return str(timed["text"]) if isinstance(timed, dict) else ""


def after(bench: Bench, directory: Path) -> Bench:
    """The next run of the service."""
    return Bench(directory, bench.store.past(Place.of(the_bay())))


def test_it_starts_by_itself_at_that_time(tmp_path: Path, wall: Wall) -> None:
    bench = held(tmp_path)
    bench.step(5)
    document = bench.bay.status()
    assert (document["state"], told(bench)) == ("HELD", "starts at 22:00 (asked by root for kim at 18:10)")
    coming = document["next"]
    assert isinstance(coming, dict) and (coming["by_itself"], coming["at"]) == (True, AT_S)
    wall.now_s = AT_S - 0.1
    assert bench.step(5) is State.HELD
    wall.now_s = AT_S
    bench.charging()
    assert told(bench) == ""
    assert journal(bench) == ["started at 22:00, as root for kim asked at 18:10"]
    wall.now_s = AT_S - 7200  # the clock is set back: it has been made
    asks(bench, Asked(Request.STOP, LEE))
    wall.now_s = AT_S + 1
    assert bench.step(20) is State.HELD


CANCELLED = "the start at 22:00, asked by root for kim at 18:10, is cancelled: "


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        (Asked(Request.STOP, LEE), "stopped by root for lee at 18:10"),
        (Asked(Request.STOP), "stopped by the operator"),
        (Asked(Request.START, LEE), "started by root for lee at 18:10"),
        (Asked(Request.START, LEE, start_unix_s=AT_S + 600), "starts at 22:10 (asked by root for lee at 18:10)"),
    ],
    ids=["stop", "stop by nobody known", "start", "start for later"],
)
def test_a_stop_or_another_start_cancels_it(tmp_path: Path, wall: Wall, asked: Asked, why: str) -> None:
    bench = held(tmp_path)
    asks(bench, asked)
    assert journal(bench) == [CANCELLED + why]
    asks(bench, Asked(Request.STOP, KIM))
    bench.step(20)
    wall.now_s = AT_S
    assert bench.step(20) is State.HELD
    timed = bench.store.past(bench.bay.place).timed
    assert timed is None or timed.outcome is not None


def test_who_has_cancelled_it_is_told_for_a_day_over_a_restart(tmp_path: Path, wall: Wall) -> None:
    before = held(tmp_path)
    lee = Asker(behind="lee", uid=0, unix_s=ASKED_S, because="wet floor")
    asks(before, Asked(Request.STOP, lee))
    asks(before, Asked(Request.STOP, KIM))  # which changes nothing of it
    bench = after(before, tmp_path / "2")
    bench.step()
    assert told(bench) == CANCELLED + "stopped by root for lee at 18:10: wet floor"
    wall.now_s = AT_S + 86401
    bench.step()
    assert told(bench) == ""


def journal(bench: Bench) -> list[str]:
    """What the journal says of starts for later."""
    found = [fields_of(line) for _, _, _, line in bench.journal._waiting[False] if line[0] == "timed_start"]
    return [str(one["text"]) for one in found]


def test_nobody_is_told_to_start_what_starts_by_itself(tmp_path: Path, wall: Wall) -> None:
    bench = held(tmp_path)
    bench.step()
    document = bench.bay.status()
    assert (document["reason"], told(bench)[:15]) == ("stopped by root for kim at 18:10", "starts at 22:00")
    asks(bench, Asked(Request.STOP, LEE))
    assert str(bench.bay.status()["reason"]).endswith("; to go on: orchestrator start bay-1")


def test_a_pause_since_cancels_it(tmp_path: Path, wall: Wall) -> None:
    """The floor is wet: who asked for the start did not know."""
    bench = Bench(tmp_path)
    bench.charging()
    asks(bench, Asked(Request.START, KIM, start_unix_s=AT_S))
    asks(bench, Asked(Request.PAUSE, LEE))
    bench.until(State.SUSPENDED)
    assert told(bench) == CANCELLED + "paused by root for lee at 18:10"
    wall.now_s = AT_S
    assert bench.step(60) is State.SUSPENDED


def test_the_newest_time_counts(tmp_path: Path, wall: Wall) -> None:
    bench = held(tmp_path)
    asks(bench, Asked(Request.START, LEE, start_unix_s=AT_S + 600))
    assert told(bench) == "starts at 22:10 (asked by root for lee at 18:10)"
    wall.now_s = AT_S
    assert bench.step(20) is State.HELD


def test_it_survives_a_restart_and_is_made_up_to_an_hour_late(tmp_path: Path, wall: Wall) -> None:
    before = held(tmp_path)
    wall.now_s = AT_S + 3500
    bench = after(before, tmp_path / "2")
    bench.charging()
    wall.now_s = AT_S + 3700
    late = after(before, tmp_path / "3")
    late.until(State.HELD)
    assert told(late) == (
        "the start at 22:00, asked by root for kim at 18:10, was not made: it could only be made 62 min late; to start "
        "it now: orchestrator start bay-1"
    )
    assert any(one.startswith("bay-1: the start at 22:00, asked by root for kim") for one in late.said)
    assert late.step(20) is State.HELD
    wall.now_s += 86400
    late.step()
    assert told(late) == ""


def test_what_refuses_it_is_told(tmp_path: Path, wall: Wall) -> None:
    latched = PersistedFault(Cause.of("said", text="57 °C"), latched=True, raised=10.0, clean=5.0)
    bench = Bench(tmp_path, Persisted(faults={"hot_trip": latched}))
    bench.until(State.TRIPPED)
    asks(bench, Asked(Request.START, KIM, start_unix_s=AT_S))
    wall.now_s = AT_S + 5
    assert bench.step(20) is State.TRIPPED
    tried = told(bench)
    assert tried.startswith("was to start at 22:00 (asked by root for kim at 18:10) and is tried again until ")
    assert "hot_trip: start is refused before a reset" in tried
    bench.now_s += 60
    bench.step(20)
    assert told(bench).startswith(
        "the start at 22:00, asked by root for kim at 18:10, was not made: hot_trip: start is refused before a reset: "
    )
    again = after(bench, tmp_path / "2")
    again.step()
    assert told(again) == told(bench)


def test_a_charge_that_was_interrupted_since_is_not_resumed_by_it(tmp_path: Path, wall: Wall) -> None:
    """Who asked for it did not know that somebody must look first."""
    before = Bench(tmp_path)
    before.charging()
    asks(before, Asked(Request.START, KIM, start_unix_s=AT_S))
    bench = after(before, tmp_path / "2")
    bench.until(State.HELD)
    document = bench.bay.status()
    coming = document["next"]
    assert document["alarm"] == "attention" and isinstance(coming, dict) and not coming["by_itself"]
    wall.now_s = AT_S
    assert bench.step(20) is State.HELD
    bench.now_s += 60
    assert bench.step(20) is State.HELD
    assert "was not made: at " in told(bench) and "ended in mid-charge" in told(bench)


def test_what_had_to_be_looked_at_already_does_not_hinder_it(tmp_path: Path, wall: Wall) -> None:
    before = Bench(tmp_path)
    before.charging()
    bench = after(before, tmp_path / "2")
    bench.until(State.HELD)
    asks(bench, Asked(Request.START, KIM, start_unix_s=AT_S))
    coming = bench.bay.status()["next"]
    assert isinstance(coming, dict) and coming["by_itself"]
    wall.now_s = AT_S
    bench.charging()


def test_what_comes_next_of_a_pause_is_the_start(tmp_path: Path, wall: Wall) -> None:
    bench = Bench(tmp_path)
    bench.charging()
    asks(bench, Asked(Request.PAUSE, LEE))
    bench.until(State.SUSPENDED)
    asks(bench, Asked(Request.START, KIM, start_unix_s=AT_S))
    coming = bench.bay.status()["next"]
    assert isinstance(coming, dict) and (coming["by_itself"], coming["at"]) == (True, AT_S)
    wall.now_s = AT_S
    bench.charging()


@pytest.mark.parametrize(("request_", "is_kept"), [(Request.PAUSE, True), (Request.STOP, False)])
def test_a_request_before_the_first_decision(tmp_path: Path, wall: Wall, request_: Request, is_kept: bool) -> None:
    bench = after(held(tmp_path), tmp_path / "2")
    asks(bench, Asked(request_, LEE))
    bench.step()
    assert told(bench).startswith("starts at" if is_kept else CANCELLED)
    timed = bench.store.past(bench.bay.place).timed
    assert timed is not None and (timed.outcome is None) is is_kept


def test_the_command_to_type_is_not_mixed_with_a_persons_words(tmp_path: Path, wall: Wall) -> None:
    bench = held(tmp_path)
    kim = Asker(behind="kim", uid=0, unix_s=ASKED_S, because="night tariff")
    asks(bench, Asked(Request.START, kim, start_unix_s=AT_S))
    wall.now_s = AT_S + 3700
    bench.step(2)
    assert told(bench).endswith("62 min late: night tariff; to start it now: orchestrator start bay-1")


def test_after_a_restart_it_waits_for_the_battery(tmp_path: Path, wall: Wall) -> None:
    """A charge to a target needs its SOC, which nobody has heard yet."""
    before = held(tmp_path, target_pct=60.0)
    wall.now_s = AT_S + 60
    bench = after(before, tmp_path / "2")
    soc_pct = bench.battery.values.pop("soc_pct")
    assert bench.step(20) is State.HELD
    bench.battery.values["soc_pct"] = soc_pct
    bench.charging()
    assert "charges once to 60 %, asked by root for kim at 18:10" in str(bench.bay.status()["target"])


def test_what_somebody_else_has_paused_is_spared_by_a_start_of_all_for_later(tmp_path: Path, wall: Wall) -> None:
    bench = Bench(tmp_path)
    bench.charging()
    asks(bench, Asked(Request.PAUSE, LEE))
    bench.until(State.SUSPENDED)
    answer = asks(bench, Asked(Request.START, KIM, spares=True, start_unix_s=AT_S))
    assert answer.startswith("left alone: paused by root for lee at 18:10")
    assert told(bench) == ""


def test_what_the_disk_does_not_take_is_forgotten(tmp_path: Path, wall: Wall) -> None:
    bench = held(tmp_path)
    asks(bench, Asked(Request.START, KIM))
    bench.charging()
    bench.disk = False
    asked = Asked(Request.START, KIM, start_unix_s=AT_S)
    bench.bay.ask(asked)
    bench.step(15)
    bench.bay._answers.look(bench.now_s)
    assert say(asked.answer).startswith("not done: ")
    assert (told(bench), bench.bay.status()["state"]) == ("", "CHARGING")


def test_nobody_known_may_ask_too(tmp_path: Path, wall: Wall) -> None:
    bench = Bench(tmp_path)
    bench.until(State.CHARGING)
    asks(bench, Asked(Request.STOP))
    asks(bench, Asked(Request.START, start_unix_s=AT_S, target_pct=60.0))
    assert told(bench).startswith("starts at 22:00 and charges once to 60 % (asked by ? at ")
    wall.now_s = AT_S
    bench.charging()
    target = bench.bay.status()["target"]
    assert isinstance(target, dict) and (target["soc_pct"], target["text"]) == (60.0, "charges once to 60 %")


# --- what a request says ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("target", [0, 100.5, -1, float("nan"), True, "60", [], {}])
def test_a_target_is_a_soc(target: object) -> None:
    with pytest.raises(RequestError) as error:
        Terms.of({"verb": START_WITH, "to": target}, ASKED_S)
    assert say(error.value.cause).endswith(": it is a SOC in percent, above 0 and at most 100")


def test_only_a_start_has_terms() -> None:
    assert Terms.of({"verb": "stop", "to": 60, "at": "22:00"}, ASKED_S) == Terms()


@pytest.mark.parametrize(
    "request_", [{"verb": "start", "to": 60}, {"verb": "start", "at": "22:00"}, {"verb": START_WITH, "target": 60}]
)
def test_a_start_that_says_more_than_is_understood_is_refused(request_: dict[str, object]) -> None:
    """Else it would charge at once and to the policy's target, which nobody asked for. No stop is refused for that."""
    with pytest.raises(RequestError) as caught:
        Terms.of(request_, ASKED_S)
    assert caught.value.cause.id == "start_keys_unknown"
    assert Terms.of({"verb": "stop", "bays": None, "why": "smoke"}, ASKED_S) == Terms()


def test_an_answer_says_when_it_starts() -> None:
    terms = Terms.of({"verb": START_WITH, "to": 60, "at": "22:00"}, ASKED_S)
    assert terms.fields == {"target_soc_pct": 60.0, "start_at": AT_S}
    done: list[dict[str, object] | None] = [None, {"language": "en"}]
    results = terms.told(lambda: done.pop(0), lambda: ASKED_S, "en")
    assert results() is None
    answer = results()
    assert answer is not None and isinstance(then := answer["then"], dict)
    assert then["text"] == "it starts at 22:00, in 3 h 50 min"


@pytest.mark.parametrize("target", ["0", "101", "nan"])
def test_a_wrong_target_is_wrong_use(target: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["start", "bay-1", "--to", target]) == 2
    assert f"start: --to {target}: it is a SOC in percent, above 0 and at most 100" in capsys.readouterr().err


def test_a_target_may_be_written_as_it_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["start", "bay-1", "--to", "101%"]) == 2
    assert "start: --to 101: it is a SOC in percent" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["start", "bay-1", "--to", "full"])
    assert "argument --to: invalid percent value: 'full'" in capsys.readouterr().err


# --- which time is meant ----------------------------------------------------------------------------------------------


@pytest.fixture(name="berlin")
def _berlin(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def unix_s(text: str) -> float:
    return datetime.fromisoformat(text).timestamp()


@pytest.mark.usefixtures("berlin")
@pytest.mark.parametrize(
    ("text", "now", "meant", "doubt"),
    [
        ("22:00", "2026-11-28T18:10+01:00", "2026-11-28T22:00+01:00", ""),
        ("9:30", "2026-11-28T18:10+01:00", "2026-11-29T09:30+01:00", ""),
        ("22:00", "2026-11-28T22:00+01:00", "2026-11-29T22:00+01:00", ""),
        ("2026-12-24T06:00", "2026-11-28T18:10+01:00", "2026-12-24T06:00+01:00", ""),
        ("2026-12-24 06:00Z", "2026-11-28T18:10+01:00", "2026-12-24T07:00+01:00", ""),
        ("03:30", "2027-03-27T22:00+01:00", "2027-03-28T03:30+02:00", ""),
        ("02:30", "2027-03-27T22:00+01:00", "2027-03-28T03:30+02:00", "the clock skips 02:30 that day"),
        ("02:30", "2026-10-24T22:00+02:00", "2026-10-25T02:30+02:00", "the one in UTC+0200 is meant"),
        ("02:30", "2026-10-25T02:45+02:00", "2026-10-25T02:30+01:00", "the one in UTC+0100 is meant"),
        ("2026-10-25T02:30+01:00", "2026-10-24T22:00+02:00", "2026-10-25T02:30+01:00", ""),
    ],
)
def test_which_instant_is_meant(text: str, now: str, meant: str, doubt: str) -> None:
    found_s, why = instant(text, unix_s(now))
    assert found_s == unix_s(meant)
    assert say(why).endswith(doubt) and bool(doubt) is (why is not None)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("late", "--at late: that is no time; write 22:00, or 2026-11-28T22:00"),
        ("24:00", "--at 24:00: that is no time"),
        ("2026-11-29", "--at 2026-11-29: that is no time"),
        ("2099-12-31T23:59", "--at 2099-12-31T23:59: that is more than 366 days ahead"),
        ("9999-12-31T23:59", "--at 9999-12-31T23:59: that is no time"),
        ("0001-01-01T00:00", "--at 0001-01-01T00:00: that"),
        ("2026-11-28T18:00", "--at 2026-11-28T18:00: that time has passed"),
        (12, "--at 12: that is no time"),
        ("x" * 500, "--at xxxx"),
    ],
)
def test_what_is_no_time_to_come(text: object, why: str) -> None:
    with pytest.raises(RequestError) as error:
        instant(text, ASKED_S)
    assert say(error.value.cause).startswith(why)


def test_a_clock_that_was_never_set_waits_for_nothing() -> None:
    with pytest.raises(RequestError) as error:
        instant("22:00", 100.0)
    assert say(error.value.cause).startswith("the clock of this machine has never been set")
