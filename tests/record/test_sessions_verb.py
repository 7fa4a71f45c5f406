"""`orchestrator sessions`: the charges on record as a table, a page, CSV and JSON."""

import csv
import io
import json
import re
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.columns import width_of
from orchestrator.model import Request, State
from orchestrator.record import index
from orchestrator.record.lines import encoded
from orchestrator.record.table import as_csv
from tests.record.kept import Kept
from tests.record.made import end


@pytest.fixture(name="journal")
def _journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A journal with a full charge, one with a pause that was stopped, and one that is open."""
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    kept = Kept(tmp_path)
    monkeypatch.setattr("orchestrator.service.bay.time", kept.wall)
    kept.bench.charging()
    kept.bench.battery.values["soc_pct"] = 100.0
    kept.bench.until(State.FULL)
    kept.bench.battery.values["soc_pct"] = 50.0
    kept.bench.charging()
    kept.bench.ask(Request.PAUSE)
    kept.bench.until(State.SUSPENDED)
    kept.bench.ask(Request.START)
    kept.bench.charging()
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    kept.bench.ask(Request.START)
    kept.bench.charging()
    kept.recorder.turn()
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0) -> str:
    assert main(["sessions", *arguments]) == status
    out, err = capsys.readouterr()
    return out if status == 0 else err


def test_the_table_has_the_newest_charge_first(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head, newest, stopped, full, total = said(capsys, "--journal", str(journal)).splitlines()
    assert head.split()[:4] == ["BEGAN", "BAY", "BATTERY", "LASTED"]
    assert "  not ended; last recorded at 2026-11-28 " in newest
    assert stopped.endswith("stopped by the operator")
    assert "50→100 %" in full
    assert "full: SOC 100 %" in full
    assert re.fullmatch(r"3 charges: \d\.\d\d Ah, 0\.\d{3} kWh", total)


def test_the_table_fits_a_terminal(
    journal: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for language in ("C.UTF-8", "ko_KR.UTF-8"):
        monkeypatch.setenv("LC_ALL", language)
        for width in (60, 80):
            monkeypatch.setattr("orchestrator.service.sessions_verb.own_width", lambda width=width: width)
            lines = said(capsys, "--journal", str(journal)).splitlines()
            assert [line for line in lines if width_of(line) > width] == []


def test_it_is_korean_for_koreans(
    journal: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LC_ALL", "ko_KR.UTF-8")
    assert "작업자가 정지했습니다" in said(capsys, "--journal", str(journal))


def test_bay_battery_time_and_number_choose(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def count(*arguments: str) -> int:
        return len(json.loads(said(capsys, "--json", "--journal", str(journal), *arguments)))

    assert count() == 3
    assert count("--limit", "2") == 2
    assert count("--limit", "0") == 3
    assert count("--bay", "bay-*") == 3
    assert count("--bay", "bay-2") == 0
    assert count("--battery", "can0:0x10") == 3
    assert count("--battery", "can0:0x11") == 0
    assert count("--since", "2026-11-28T00:00Z") == 3
    assert count("--since", "2126-11-28") == 0


def test_none_of_these_is_not_none_at_all(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for choice in (("--bay", "bay-2"), ("--battery", "can0:0x11"), ("--since", "2126-11-28")):
        told = said(capsys, "--journal", str(journal), *choice)
        assert told == "there are charges on record, but none of these\n"


def test_csv_is_what_a_spreadsheet_reads(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = said(capsys, "--csv", "--journal", str(journal))
    assert text.startswith("\ufeffid,station,bay,")
    assert text.count("\r\n") == 4
    *_, full = csv.DictReader(io.StringIO(text.removeprefix("\ufeff"), newline=""))
    assert (full["soc_begin_pct"], full["result"]) == ("50.0", "full")
    assert full["begin"].endswith("Z")
    assert full["end"].endswith("Z")
    assert float(full["charger_ah"]) > 0
    assert (full["soC"], full["soH"], full["serialNumber"]) == (full["soc_end_pct"], full["soh_pct"], ""), (
        "OCPP's names"
    )
    told = {**end(1, 1), "battery": {"id": "SN-7", "source": "serial_number"}}
    (row,) = csv.DictReader(io.StringIO("".join(as_csv([told], "en"))))
    assert row["serialNumber"] == "SN-7"


def test_one_charge_is_shown_by_the_end_of_its_id(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, stopped, _ = json.loads(said(capsys, "--json", "--journal", str(journal)))
    page = said(capsys, "show", stopped["id"][-6:].lower(), "--journal", str(journal))
    assert f"charge {stopped['id']}: bay-1, a station" in page
    assert "battery can0:0x10, assumed from its node id" in page
    assert "ended: stopped by the operator" in page
    assert "Pauses:" in page
    assert "paused by the operator" in page
    assert "SOC, %" in page


def test_an_empty_record_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "--journal", str(tmp_path)) == "no charge on record\n"


@pytest.mark.parametrize(
    ("arguments", "status", "expected"),
    [
        (("show",), 2, "expected 'sessions', 'sessions show ID [--json | --html FILE]', 'sessions replay ID"),
        (("list",), 2, "expected 'sessions', 'sessions show ID [--json | --html FILE]', 'sessions replay ID"),
        (("--html", "x.html"), 2, "--html is for 'sessions show ID'"),
        (("show", "0000", "--policy", "x"), 2, "--policy is for 'sessions replay ID'"),
        (("show", "0000"), 1, "no charge on record has an id that ends with 0000"),
        (("--limit", "-1"), 2, "--limit -1: expected the number of charges"),
        (("--since", "yesterday"), 2, "--since yesterday: expected 90min"),
    ],
)
def test_wrong_use_says_what_is_expected(
    journal: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], status: int, expected: str
) -> None:
    assert expected in said(capsys, *arguments, "--journal", str(journal), status=status)


def test_a_journal_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "there is no such directory" in said(capsys, "--journal", str(tmp_path / "no"), status=2)


def test_one_charge_is_decided_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    kept = Kept(tmp_path)
    monkeypatch.setattr("orchestrator.service.bay.time", kept.wall)
    for _ in range(2):
        kept.bench.battery.values["soc_pct"] = 50.0
        kept.bench.charging()
        kept.bench.battery.values["soc_pct"] = 100.0
        kept.bench.until(State.FULL)
        kept.recorder.turn()
    kept.bench.journal._write()
    place = str(tmp_path)
    _, first = (one["id"] for one in json.loads(said(capsys, "--json", "--journal", place)))
    again = re.search(
        r"^bay-1: (\d+) decisions in .* all as recorded", said(capsys, "replay", first, "--journal", place)
    )
    assert main(["replay", place]) == 0
    all_ = re.search(r"^bay-1: (\d+) decisions", capsys.readouterr().out)
    assert again is not None
    assert all_ is not None
    assert 10 < int(again[1]) < int(all_[1]) * 0.7
    other = said(capsys, "replay", first, "--policy", "long-life-48v", "--journal", place)
    assert re.search(r"^bay-1: \d+ decisions, \d+ differences? \(.* → long-life-48v\)", other, re.MULTILINE)


def test_the_usual_table_is_the_newest_fifty(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    (tmp_path / "sessions").mkdir()
    records = b"".join(encoded(end(number, 1)) for number in range(60))
    (tmp_path / "sessions" / "2026-11.jsonl").write_bytes(records)

    def lines(*arguments: str) -> list[str]:
        return said(capsys, "--journal", str(tmp_path), *arguments).splitlines()

    assert len(lines()) == 53
    assert lines()[-1] == "the newest 50; there are more: --limit 0 lists all"
    assert len(lines("--limit", "50")) == 52
    assert len(lines("--limit", "0")) == len(lines("--since", "2026-11-01")) == 1 + len(lines("--csv")) == 62


def test_the_index_is_built_anew_when_asked(
    journal: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert said(capsys, "rebuild", "--journal", str(journal)) == "index built anew; charges: 3\n"
    monkeypatch.setattr(index, "PAUSE_S", 0.0)
    with index._locked(journal / "sessions"):
        assert "another command is building the index" in said(capsys, "rebuild", "--journal", str(journal), status=1)
    (journal / "sessions" / index.NEW).mkdir()
    assert "no index can be built in" in said(capsys, "rebuild", "--journal", str(journal), status=1)
