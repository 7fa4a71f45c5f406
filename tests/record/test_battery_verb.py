"""`orchestrator battery`: the batteries on record, and the life of one with the source of its id."""

import json
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.record.lines import Record, encoded
from tests.record.made import end


def assumed(record: Record, soh_pct: float) -> Record:
    values = {**record["values"], "soh_pct": dict.fromkeys(("begin", "end", "lowest", "highest"), soh_pct)}
    return {**record, "battery": {**record["battery"], "source": "assumed"}, "values": values}


@pytest.fixture(name="journal")
def _journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three charges of B-1, whose id was assumed at first, and one of B-2 in between."""
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    (tmp_path / "sessions").mkdir()
    fault = {"id": "hot_trip", "effect": "TRIP", "times": 2, "cause": {}}
    records = [
        assumed(end(1, 1, 10.0), 99.0), end(30, 1, 20.0, battery="B-2"), end(60, 1, 30.0),
        {**end(61, 1, 40.0), "faults": [fault]},
    ]  # fmt: skip
    (tmp_path / "sessions" / "2026-11.jsonl").write_bytes(b"".join(map(encoded, records)))
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], journal: Path, *arguments: str, status: int = 0) -> str:
    assert main(["battery", *arguments, "--journal", str(journal)]) == status
    out, err = capsys.readouterr()
    return out if status == 0 else err


def test_each_battery_is_in_the_list_once(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, first, second = said(capsys, journal).splitlines()
    assert first.split() == ["B-1", "assumed,", "typed", "3", "2026-11-28", "2026-12-01", "80.0", "4.00", "97", "%"]
    assert second.split()[:3] == ["B-2", "typed", "1"]
    assert [one["charges"] for one in json.loads(said(capsys, journal, "--json"))] == [3, 1]


def test_a_life_says_where_the_id_is_from(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    life = said(capsys, journal, "B-1").splitlines()
    assert life[:2] == [
        "battery B-1, 2026-11-28 to 2026-12-01; charges: 3, 80.0 Ah, 4000 Wh",
        "SOH by its BMU: 99 % at first, 97 % at last",
    ]
    assert any("assumed from its node id, 2026-11-28 to 2026-11-28; charges: 1" in line for line in life)
    assert "  typed by an operator, 2026-12-01 to 2026-12-01; charges: 2" in life
    assert "  faults in its charges: hot_trip ×2" in life
    assert any(line.startswith("  capacity: not known yet: it takes 3 charges") for line in life)
    assert len([line for line in life if line.startswith("2026-")]) == 3


def test_its_newest_charges_are_enough(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    life = said(capsys, journal, "B-1", "--limit", "1").splitlines()
    assert len([line for line in life if line.startswith("2026-")]) == 1
    assert "charges: 3," in life[0]
    told = json.loads(said(capsys, journal, "B-1", "--json"))
    assert (len(told["charges"]), told["health"]["charges"], told["health"]["capacity_ah"]) == (3, 3, None)


def test_it_is_korean_for_koreans(
    journal: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LC_ALL", "ko_KR.UTF-8")
    assert "작업자가 입력, 2026-12-01 ~ 2026-12-01 충전 2회" in said(capsys, journal, "B-1")


def test_a_battery_that_nobody_knows(journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no charge of a battery B-9 is on record" in said(capsys, journal, "B-9", status=1)
    assert "--limit -1: expected the number" in said(capsys, journal, "B-1", "--limit", "-1", status=2)


def test_a_station_without_charges(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, tmp_path) == "no charge on record\n"
