"""Allowed but hardly intended: every warning on its own file, and none on the shipped files."""

from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.config.load import check, load_policy
from orchestrator.config.shipped import shipped_dir
from orchestrator.workbench.prove.lint import LINT

ODD = Path(__file__).parent / "odd"


@pytest.mark.parametrize(
    "name", ["policy", "quick", "narrow", "cells", "physics", "station", "wiring", "places", "supplies"]
)
def test_each_is_told_at_its_key(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ODD)
    assert main(["check", f"{name}.yaml"]) == 0, "it can be used as it is"
    assert capsys.readouterr().err == (ODD / f"{name}.txt").read_text(encoding="utf-8")


def test_the_files_have_every_warning() -> None:
    """Each text of the lint occurs in one of them."""
    said = "\n".join(path.read_text(encoding="utf-8") for path in ODD.glob("*.txt"))
    for words in (
        "precharge never begins", "the pulse stage ends as it begins", "the taper is never seen", "only the BMU's own",
        "too near to full", "charging pauses outside", "is refused", "no current flows outside", "will flap",
        "too narrow", "never flow", "the charge is over at", "are a fault", "no charge begins",
        "deeply discharged packs are refused",
        "leaves no room", "data sheet, not the discharging one", "protect nothing", "has no effect", "cold cells plate",
        "the colder", "the hotter", "the fuller", "the older", "nearly empty", "is in force instead",
        "honest instruments",
        "are few for nmc", "is no deep discharge", "refuses packs that are not empty", "% everywhere", "V everywhere",
        "none of CANopen's", "after the next plug", "placeholder", "example's steps", "no BMU has the id",
        "in no supply", "no charge ever begins", "they share these", "no bay is on it",
        "V is wider", "A is wider", "°C is wider", "switch the line's direction", "there is no",
    ):  # fmt: skip
        assert words in said, words


def test_a_right_station_is_not_warned_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same keys as in `wiring.yaml`, as they should be."""
    monkeypatch.chdir(ODD)
    assert check(["wiring-right.yaml"], LINT) == []


def test_a_file_with_errors_gets_no_warnings(tmp_path: Path) -> None:
    broken = tmp_path / "policy.yaml"
    broken.write_text((ODD / "policy.yaml").read_text(encoding="utf-8").replace("max_ah: 44", "max_ah: -1"))
    assert {finding.severity for finding in check([broken], LINT)} == {"error"}
    assert main(["check", str(broken)]) == 1


def test_a_service_is_not_kept_from_a_policy_by_a_warning() -> None:
    assert load_policy(ODD / "policy.yaml").policy == "odd"


def test_nothing_is_odd_about_what_ships() -> None:
    files = [path for folder in ("policies", "configs") for path in (shipped_dir() / folder).rglob("*.yaml")]
    assert len(files) > 10
    assert check(files, LINT) == []
