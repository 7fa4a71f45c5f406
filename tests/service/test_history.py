"""What happened, in sentences: from all parts of a journal, without what says nothing new, in either language."""

import gzip
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from time import localtime, strftime, time
from typing import Any

import pytest

from orchestrator.columns import width_of
from orchestrator.errors import NoServiceError, UsageError
from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.record.utc import utc
from orchestrator.service import history as reading
from orchestrator.service.history import Happened, Story
from orchestrator.service.history_page import HistoryPage, as_json
from orchestrator.service.history_verb import ON_PAGE, last_events
from orchestrator.service.journal import Journal
from orchestrator.service.journal_place import event_files, journal_place
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import say
from tests.whole.station import orchestrator

NOW_S = 1_800_000_000.0
HOT = Cause.of("over_temperature", key="pack.temperature_c", place="p.yaml:3", pack_c=45.2, limit_c=45, again_c=40.0)
HOT_TEXT = "the pack has 45.2 °C, the limit is 45 °C (p.yaml:3); it charges again below 40 °C"


def record(kind: str, bay: str = "bay-1", t_s: float = 100.0, **more: Any) -> dict[str, Any]:
    return {"t": t_s, "wall": utc(NOW_S + t_s), "bay": bay, "kind": kind, **more}


def goes(before: str | None, to: str, cause: Cause, **more: Any) -> dict[str, Any]:
    return record("transition", **{"from": before, "to": to, "reason": say(cause), "cause": plain(cause), **more})


def run(began_s: float, boot: str = "boot", t_s: float | None = None) -> dict[str, Any]:
    at_s = began_s if t_s is None else t_s
    return record("run", "", at_s, version=5, boot=boot, run=f"{boot}/{began_s:.6f}/{NOW_S:.0f}")


def station(id_: str, t_s: float = 100.0, **params: Any) -> dict[str, Any]:
    cause = Cause.of(id_, **params)
    return record("station", str(params.get("bay", "")), t_s, text=say(cause), cause=plain(cause))


def told(*records: Mapping[str, Any], language: str = "en") -> list[Happened]:
    story = Story(language)
    return [one for record in records if (one := story.tell(dict(record))) is not None]


def texts(*records: Mapping[str, Any], language: str = "en") -> list[str]:
    return [one.text for one in told(*records, language=language)]


def test_a_start_for_later_is_told_when_it_is_asked_for_and_once_when_it_was_not_made() -> None:
    why = Cause.of("target_reached", soc_pct=91.0, target_pct=70.0)
    asked: dict[str, Any] = {"who": "kim", "asked_unix_s": NOW_S, "start_unix_s": NOW_S + 600}
    missed = Cause.of("start_not_made", **asked, why=why, bay="bay-1")
    missed = WallClock(700.0, NOW_S + 700).told(missed) or missed
    lines = (
        record("request", request="start", by="kim", accepted=True, answer="", cause=None, start_at=NOW_S + 600),
        record("request", request="start", by="kim", accepted=True, answer="", cause=None),
        record("timed_start", text=say(missed), cause=plain(missed)),
        station("bay_refused", bay="bay-1", why=missed),
    )
    at, then = strftime("%H:%M", localtime(NOW_S + 100)), strftime("%H:%M", localtime(NOW_S + 600))
    first, second = texts(*lines)
    assert first == f"starts at {then} (asked by kim at {at})"
    assert second.startswith(f"the start at {then}, asked by kim at ") and "was not made: its SOC" in second
    assert "실행하지 않았습니다" in texts(*lines, language="ko")[1]


# --- sentences -------------------------------------------------------------------------------------------------------


def test_a_charge_in_sentences_that_say_each_thing_once() -> None:
    trip = HOT.with_("over_temperature", effect="TRIP", then=Cause.of("refused_while", request="reset"))
    fault = record("fault", id="over_temperature", event="raised", effect="TRIP", text=say(trip), cause=plain(trip))
    figures: dict[str, Any] = {
        "elapsed_s": 3840.0,
        "charged_ah": 6.42,
        "charged_wh": 330.4,
        "soc_start_pct": 35.0,
        "soc_pct": 54.0,
    }
    end = record("session", t_s=101.0, event="end", **figures, result=say(trip), cause=plain(trip))
    begin = record("session", event="begin", **{**figures, "elapsed_s": 0.0}, result="", cause=None)
    assert texts(
        goes(None, "STARTING", Cause("service_started")),
        begin,
        record("command", action="stop", value=0),
        record("decision", state="CHARGING", reason="step 5", step=None),
        goes("CHARGING", "STOPPING", trip),
        fault,
        goes("STOPPING", "TRIPPED", trip, t_s=101.0),
        end,
        record("fault", id="x", event="cleared", effect="TRIP", text="x", cause=plain(HOT.with_(past=True))),
    ) == [
        "STARTING: the service has just started",
        "a charge begins at SOC 35 %",
        f"CHARGING → STOPPING: {HOT_TEXT}",
        "STOPPING → TRIPPED",
        "the charge has ended; 6.42 Ah, 330 Wh in 1 h 04 min; SOC 35 % → 54 %",
        "over: the pack had 45.2 °C, the limit is 45 °C (p.yaml:3); it charges again below 40 °C",
    ]


def test_a_charge_left_open_by_the_last_run_does_not_begin_again() -> None:
    left = record("session", event="begin", elapsed_s=90.0, charged_ah=0.35, charged_wh=17.0, soc_start_pct=40.0)
    assert texts(left) == ["the last run left a charge open: 0.35 Ah, 17 Wh in 90 s"]


def test_another_fault_beside_it_is_told_and_a_result_that_nobody_told_as_well() -> None:
    other = Cause("operator_stop")
    fault = record("fault", id="over_temperature", event="raised", effect="PAUSE", text="", cause=plain(HOT))
    end = record("session", event="end", elapsed_s=90, result="", cause=plain(other))
    assert texts(goes("IDLE", "HELD", HOT), {**fault, "t": 99.0}, end) == [
        f"IDLE → HELD: {HOT_TEXT}",
        f"PAUSE: {HOT_TEXT}",
        "the charge has ended; – Ah, – Wh in 90 s; stopped by the operator",
    ]


def test_moments_are_the_time_of_day_of_the_record() -> None:
    cause = Cause.of("gone", gone_t_s=90.0)
    (text,) = texts(goes("TRIPPED", "HELD", cause, t_s=100.0))
    assert text == f"TRIPPED → HELD: gone since {strftime('%H:%M:%S', localtime(NOW_S + 90))}"


def test_it_is_told_in_the_readers_language_or_as_it_was_written() -> None:
    one = goes("CHARGING", "HELD", Cause("operator_stop"))
    assert texts(one, language="ko") == ["CHARGING → HELD: 작업자가 정지했습니다"]
    assert texts({**one, "reason": "so steht es da"}, language="") == ["CHARGING → HELD: so steht es da"]
    assert texts({**one, "cause": {"id": "of_tomorrow", "params": {}}, "reason": "it says"}, language="ko") == [
        "CHARGING → HELD: it says"
    ]


def test_who_is_named_where_that_is_known() -> None:
    asked = record("request", text="stop", by="kim")
    assert texts(asked, {**asked, "by": {"user": "lee"}}, {**asked, "text": "stop by kim"}, {**asked, "by": None}) == [
        "stop (kim)", "stop (lee)", "stop by kim", "stop",
    ]  # fmt: skip


def test_what_cannot_be_told_is_left_out() -> None:
    assert told(record("snapshot"), record("tomorrow"), record("transition"), {**run(1), "run": "1"}) == []
    assert told(record("session", event="checkpoint"), {**goes("A", "B", HOT), "wall": "never"}) == []


# --- the station itself ----------------------------------------------------------------------------------------------


def test_a_run_that_ended_without_a_word_is_told_at_the_next_begin() -> None:
    begun, ended = station("service_begins", station="s", bays=1, socket="x"), station("ended_well")
    dead = "the service begins again; its last run ended without a word: it was killed"
    power = "the service begins again after a restart of the machine; its last run ended without a word: no power, "
    power += "or killed"
    found = [(one.text, one.level) for one in told(
        run(1), begun, run(1, t_s=50), ended, run(60), begun, run(70), begun, run(3, "other boot"),
    ) if one.kind == "run"]  # fmt: skip
    assert found == [("the service begins", ""), ("the service begins", ""), (dead, "attention"), (power, "attention")]


def test_a_run_of_an_older_version_says_nothing_of_its_end() -> None:
    assert texts(run(1), goes("A", "B", HOT), run(60))[-1] == "the service begins"


def test_failures_of_the_station_are_marked() -> None:
    full = station("journal_failed", error="ENOSPC", file="/j")
    levels = [one.level for one in told(full, station("journal_again"), record("lost", "", lines=7))]
    assert levels == ["attention", "", "attention"]
    assert [told(goes("A", state, HOT))[0].level for state in ("HELD", "TRIPPED", "UNCONTROLLABLE")] == [
        "", "attention", "danger",
    ]  # fmt: skip


def test_a_contactor_is_told() -> None:
    stuck = Cause("operator_stop")
    assert texts(
        record("contactor", closed=True, problem="", cause=None),
        record("contactor", closed=False, problem=say(stuck), cause=plain(stuck)),
    ) == ["the contactor is closed", "the contactor is open; stopped by the operator"]


# --- files -----------------------------------------------------------------------------------------------------------


def line(record: Mapping[str, Any]) -> str:
    return json.dumps(record, ensure_ascii=False, separators=(",", ":")) + "\n"


def stops(begin: int, end: int, bay: str = "bay-1") -> str:
    return "".join(
        line(goes(f"S{number}", "HELD", HOT.with_(key=""), bay=bay, t_s=number)) for number in range(begin, end)
    )


@pytest.fixture(name="journal")
def _journal(tmp_path: Path) -> Path:
    """Three parts with 30 events of bay-1, the last of which has a broken line."""
    directory = tmp_path / "journal"
    directory.mkdir()
    with gzip.open(directory / "events-000001.jsonl.gz", "wt") as file:
        file.write(line(run(0)) + stops(0, 10) + line(goes("A", "HELD", HOT, bay="bay-20", t_s=9.5)))
    with gzip.open(directory / "events-000002.jsonl.gz", "wt") as file:
        file.write(line(run(0, t_s=10)) + stops(10, 20))
    (directory / "events.jsonl").write_text(line(run(0, t_s=20)) + stops(20, 29) + "torn {\n" + stops(29, 30))
    return directory


def shown(journal: Path, *args: str) -> Sequence[str]:
    done = orchestrator("history", "--journal", str(journal), *args, env={"LC_ALL": "en_US.UTF-8"})
    assert "Traceback" not in done.stderr
    return [*done.stdout.splitlines(), *done.stderr.splitlines()]


def numbers(lines: Sequence[str]) -> list[int]:
    return [int(line.partition("  S")[2].partition(" ")[0]) for line in lines if "  S" in line]


def test_all_parts_are_read_newest_last_and_broken_lines_are_said(journal: Path) -> None:
    lines = shown(journal, "bay-1", "--limit", "0")
    assert numbers(lines) == list(range(30))
    begun = strftime("%Y-%m-%d %H:%M:%S", localtime(NOW_S))
    assert lines[0].startswith(f"   {begun}  bay-1  S0 → HELD")
    assert lines[-1].startswith(f"orchestrator: 1 line of the journal cannot be read and is passed over: {journal}/")
    assert numbers(shown(journal, "bay-1", "--limit", "12")) == list(range(18, 30))


def test_bays_by_pattern_and_by_time(journal: Path) -> None:
    assert len(numbers(shown(journal, "bay-1"))) == 30
    assert "bay-20" in shown(journal, "bay-2*")[0]
    since = strftime("%Y-%m-%dT%H:%M:%S", localtime(NOW_S + 12))
    until = strftime("%Y-%m-%dT%H:%M:%S", localtime(NOW_S + 22))
    assert numbers(shown(journal, "--since", since, "--until", until)) == list(range(12, 23))
    assert numbers(shown(journal, "--since", since, "--limit", "3")) == [27, 28, 29]
    assert shown(journal, "--station")[0].endswith("  station  the service begins")


def test_for_programs_there_is_an_object_on_each_line(journal: Path) -> None:
    one = json.loads(shown(journal, "bay-20", "--json")[0])
    assert one == {
        "wall": utc(NOW_S + 9.5), "bay": "bay-20", "kind": "transition", "id": "over_temperature",
        "text": f"A → HELD: {HOT_TEXT}", "level": "", "by": "",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["bay-7"], "orchestrator: nothing is recorded; of bay-7 (recorded: –)"),
        (["bay-7*"], "orchestrator: nothing is recorded; of bay-7* (recorded: bay-1, bay-20)"),
        (["--since", "soon"], "orchestrator: --since soon: expected 90min, 2h, 7d, 2026-11-28 or 2026-11-28T06:00"),
        (["--until", "7w"], "orchestrator: --until 7w: expected 90min, 2h, 7d, 2026-11-28 or 2026-11-28T06:00"),
        (["--limit", "-1"], "orchestrator: history: --limit is the number of events; 0 shows all of them"),
        (["bay-1", "--station"], "orchestrator: history: --station shows the station itself: name bays, or --station"),
    ],
)
def test_what_is_asked_in_vain_is_said(journal: Path, args: list[str], said: str) -> None:
    assert said in shown(journal, *args)


def test_no_more_is_kept_in_memory_than_is_shown(journal: Path) -> None:
    opened: list[Path] = []

    def tell(paths: Sequence[Path]) -> Iterator[Happened]:
        opened.extend(paths)
        return reading.happened(paths, "en", lambda text: b"bay-1" in text)

    found = reading.newest(event_files(journal), 12, tell)
    assert [one.text.partition(" ")[0] for one in found] == [f"S{number}" for number in range(18, 30)]
    assert [path.name for path in opened] == ["events.jsonl", "events-000002.jsonl.gz"]


def test_a_page_has_the_last_ten_of_its_bay_or_says_why_not(journal: Path) -> None:
    found = last_events(journal, "bay-1", "en", NOW_S + 30)
    assert len(found) == ON_PAGE and found[-1][1].startswith("S29 → HELD")
    assert found[-1][0] == strftime("%H:%M:%S", localtime(NOW_S + 29))
    assert last_events(journal, "bay-9", "en", NOW_S) == [("", "the journal has none of this bay")]
    ((_, why),) = last_events(journal / "none", "bay-1", "en", NOW_S)
    assert why.startswith(f"not shown: there is no journal in {journal}/none")


# --- where it is -----------------------------------------------------------------------------------------------------


def test_the_station_file_here_names_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ORCHESTRATOR_SOCKET", raising=False)
    here, installed = tmp_path / "station.yaml", tmp_path / "installed"
    with pytest.raises(UsageError, match="no journal found: no service answers"):
        journal_place(None, None, here, installed)
    installed.mkdir()
    assert journal_place(None, None, here, installed) == installed
    here.write_text("journal: {directory: run/journal}\n")
    assert journal_place(None, None, here, installed) == tmp_path / "run/journal"
    assert journal_place("named", None, here, installed) == Path("named")
    with pytest.raises(NoServiceError, match="without it, name the journal's directory with --journal"):
        journal_place(None, str(tmp_path / "none.sock"), here, installed)


def test_a_journal_that_is_not_there_or_closed_says_what_to_do(journal: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match=r"there is no journal in .*/none: name its directory with --journal"):
        event_files(journal / "none")
    (journal / "none").mkdir()
    with pytest.raises(UsageError, match="there is no journal in"):
        event_files(journal / "none")

    def closed(path: object) -> list[str]:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "listdir", closed)  # root may read everything
    with pytest.raises(NoServiceError, match="permission denied: only root and root may read this journal"):
        event_files(journal)


# --- on a terminal ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [20, 60, 200])
def test_lines_fit_and_days_have_a_heading(width: int) -> None:
    page = HistoryPage("en", width, colour=False)
    events = [Happened("", NOW_S + day * 86_400, "bay-1", "x", HOT_TEXT) for day in (0, 0, 1)]
    lines = [text for one in events for text in page.lines(one)]
    assert max(map(width_of, lines)) <= width
    assert len([text for text in lines if text.startswith("20")]) == 2


def test_failures_are_marked_and_coloured_on_a_terminal_only() -> None:
    failure = Happened("", NOW_S, "", "station", "it fails", level="attention")
    coloured = list(HistoryPage("en", 60, colour=True).lines(failure))
    assert coloured[1].startswith("\x1b[33m!  ") and coloured[1].endswith("  station  it fails\x1b[0m")
    assert "\x1b" not in "".join(HistoryPage("en", 0, colour=False).lines(failure))
    assert json.loads(as_json(failure))["level"] == "attention"


def test_what_the_service_says_of_itself_is_in_its_journal(tmp_path: Path) -> None:
    journal = Journal(tmp_path, 10, lambda: 5.0, time, boot="boot")
    journal.note(Cause("journal_again"), "en")
    journal.note(Cause.of("bay_internal", bay="bay-2", error="x"), "en")
    journal.note(Cause.of("bay_goes", bay="bay-2", before="A", state="B", reason="x"), "en")  # a record of its own
    journal._write()
    found = list(reading.happened(event_files(tmp_path), "en", lambda _: True))
    assert [(one.bay, one.kind, one.level) for one in found] == [
        ("", "run", ""), ("", "station", ""), ("bay-2", "station", "attention"),
    ]  # fmt: skip
