"""The verb `check`: how it ends, and what it says of a station beside the findings of its files."""

from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.config.shipped import shipped_dir

STATIONS = shipped_dir() / "configs" / "stations"
MAP = shipped_dir() / "configs" / "maps" / "tabos.yaml"
SCENARIO = shipped_dir() / "configs" / "scenarios" / "agv-day.yaml"
BROKEN = Path(__file__).parents[1] / "config" / "broken"


def last_line(capsys: pytest.CaptureFixture[str], *files: Path | str) -> str:
    main(["check", *map(str, files)])
    return capsys.readouterr().out.splitlines()[-1]


@pytest.fixture(autouse=True)
def _english(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LC_ALL", "C.UTF-8")


def test_it_ends_with_what_it_looked_at_and_found(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    one_bay, two_bays = STATIONS / "one-bay.yaml", STATIONS / "two-bays-rs485.yaml"
    assert last_line(capsys, two_bays) == "2 bays, 2 policies: no errors, no warnings"
    assert last_line(capsys, one_bay, two_bays, MAP, SCENARIO) == (
        "3 bays, 2 policies, 1 object map, 1 scenario: no errors, no warnings"
    ), "a policy that both name is one"
    assert last_line(capsys, Path(__file__).parent / "odd" / "policy.yaml") == "1 policy: no errors, 10 warnings"
    assert last_line(capsys, BROKEN / "station-buses.yaml") == "2 bays, 1 policy: 7 errors"
    assert last_line(capsys, BROKEN / "yaml-empty.yaml") == "1 file: 1 error"
    assert last_line(capsys, BROKEN / "station-empty-bays.yaml") == "1 file: 4 errors", "there is no bay in it"
    assert last_line(capsys, tmp_path / "none.yaml") == "1 file: 1 error"


def test_it_ends_so_in_the_language_of_the_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LC_ALL", "ko_KR.UTF-8")
    assert last_line(capsys, STATIONS / "one-bay.yaml") == "베이 1개, 정책 1개: 오류 없음, 경고 없음"


def test_what_only_the_disk_shows_counts_as_well(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    station = tmp_path / "station.yaml"
    station.write_text((STATIONS / "two-bays-rs485.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "run").touch()
    assert last_line(capsys, station).startswith("2 bays, 2 policies: 2 errors")


def test_a_station_without_errors_is_told_how_far_its_journal_reaches(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(STATIONS / "two-bays-rs485.yaml")]) == 0
    reach, _summary = capsys.readouterr().out.splitlines()
    assert ": journal: with 2 bays charging day and night, 256 MB hold about 27 days to replay" in reach
