"""`orchestrator report`: a month of charges, per bay and in all."""

import json
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.columns import width_of
from orchestrator.model import Cause
from orchestrator.record.lines import Record, encoded
from tests.record.made import begin, checkpoint, end

HOT = Cause.of("over_temperature", pack_c=45.2, limit_c=45, again_c=40.0, key="pack.temperature_c")
FAULT = {"id": "hot_trip", "effect": "TRIP", "times": 2, "cause": {}}


def grave(record: Record) -> Record:
    return {**record, "faults": [FAULT]}


@pytest.fixture(name="journal")
def _journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three charges of November by the station's clock, one of December, which is still November in UTC."""
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    (tmp_path / "sessions").mkdir()
    records = [
        end(1, 3, 10.0), end(2, 6, 20.0, bay="bay-2", battery="<B-2>"), grave(end(3, 1, 1.0, HOT)),
        begin(56), checkpoint(56, 1, 5.0),
        grave(end(58, 1, 7.0, battery="<B-3>")),
    ]  # fmt: skip
    (tmp_path / "sessions" / "2026-11.jsonl").write_bytes(b"".join(map(encoded, records)))
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0) -> str:
    assert main(["report", *arguments]) == status
    out, err = capsys.readouterr()
    return out if status == 0 else err


def test_a_month_is_that_of_the_station(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    november = said(capsys, "--month", "2026-11", "--journal", str(journal)).splitlines()
    assert november[0] == "Charges that began in 2026-11 (local time: UTC+09:00), depot"
    assert [line.split() for line in november[2:5]] == [
        ["bay-1", "3", "1", "16.0", "0.80", "30", "min"],
        ["bay-2", "1", "1", "20.0", "1.00", "1", "h", "00", "min"],
        ["all", "4", "2", "36.0", "1.80", "45", "min"],
    ]
    december = said(capsys, "--journal", str(journal)).splitlines()
    assert december[0] == "Charges that began in 2026-12 (local time: UTC+09:00), depot"


def test_it_says_how_charges_ended_and_which_battery_to_look_at(
    journal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = said(capsys, "--month", "2026-11", "--journal", str(journal))
    rows = [line.split(maxsplit=2)[:2] for line in page.splitlines()]
    assert [row for row in rows if row and row[0] in "12"] == [
        ["2", "full"],
        ["1", "charge_open"],
        ["1", "over_temperature"],
    ]
    assert "B-1  faults stopped its charges, 2 in all: hot_trip" in page
    assert "<B-2>  " not in page


def test_it_is_a_page_that_needs_nothing_else(
    journal: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LC_ALL", "ko_KR.UTF-8")
    file = journal / "report.html"
    assert said(capsys, "--month", "2026-11", "--html", str(file), "--journal", str(journal)) == f"{file}\n"
    page = file.read_text(encoding="utf-8")
    assert '<html lang="ko">' in page
    assert "점검이 필요한 배터리" in page
    assert "<td>36.0</td>" in page
    assert "http" not in page
    assert main(["report", "--month", "2026-12", "--html", str(file), "--journal", str(journal)]) == 0
    assert "<td>&lt;B-3&gt;</td>" in file.read_text(encoding="utf-8")


def test_it_fits_a_terminal(journal: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orchestrator.service.report_verb.own_width", lambda: 80)
    lines = said(capsys, "--month", "2026-11", "--journal", str(journal)).splitlines()
    assert [line for line in lines if width_of(line) > 80] == []


@pytest.mark.parametrize(
    ("arguments", "status", "expected"),
    [
        (("--month", "2026-13"), 2, "--month 2026-13: expected a year and a month, such as 2026-11"),
        (("--month", "november"), 2, "expected a year and a month"),
        (("--month", "2026-10"), 0, "no charge on record began in 2026-10"),
        (("--month", "2026-11", "--html", "/dev/null/x"), 1, "/dev/null/x cannot be written: Not a directory"),
    ],
)
def test_wrong_use_says_what_is_expected(
    journal: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], status: int, expected: str
) -> None:
    assert expected in said(capsys, *arguments, "--journal", str(journal), status=status)


def test_a_station_without_charges(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "--journal", str(tmp_path)) == "no charge on record\n"


def worn(number: int) -> Record:
    """A charge that shows 15 Ah of rated 20 Ah, of a battery whose BMU reports SOH 97 %."""
    stretch = {
        "from_pct": 20.0,
        "to_pct": 90.0,
        "charger_ah": 10.5,
        "bmu_ah": 10.5,
        "lowest_c": 20.0,
        "highest_c": 25.0,
    }
    record = end(number, 6, 10.5, battery="B-4")
    policy = {**record["policy"], "capacity_ah": 20.0}
    return {**record, "policy": policy, "measured": {"stretch": stretch, "steps": [], "hot_s": 0.0, "high_s": 0.0}}


def test_a_battery_whose_soh_does_not_fit_needs_a_look(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (journal / "sessions" / "2026-11.jsonl").open("ab") as file:
        file.writelines(encoded(worn(number)) for number in (10, 20, 30, 70))
    assert "B-4  the BMU's SOH of 97 % does not fit its charges, which show " in said(
        capsys, "--month", "2026-12", "--journal", str(journal)
    )
    assert "does not fit" not in said(capsys, "--month", "2026-10", "--journal", str(journal))


def test_programs_read_the_same(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(said(capsys, "--month", "2026-11", "--json", "--journal", str(journal)))
    assert (found["month"], found["stations"]) == ("2026-11", ["depot"])
    assert found["bays"]["bay-2"] == {"charges": 1, "full": 1, "ah": 20.0, "wh": 1000.0, "mean_full_s": 3600.0}
    assert found["total"]["charges"] == 4
    assert [(one["id"], one["charges"]) for one in found["ends"]] == [
        ("full", 2), ("charge_open", 1), ("over_temperature", 1),
    ]  # fmt: skip
    assert [(one["battery"], one["causes"][0]["id"]) for one in found["look_at"]] == [("B-1", "look_faults")]
    empty = json.loads(said(capsys, "--month", "2026-10", "--json", "--journal", str(journal)))
    assert (empty["total"]["charges"], empty["bays"], empty["look_at"]) == (0, {}, [])
