"""What the command line says of wrong use: what was expected, and what to type."""

import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.cli import main


def test_kinds_that_are_none_are_answered_with_those_that_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["decode", "--kinds", "99", "AF"])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert "'99': write two bytes in hexadecimal, e.g. 03,04" in said
    assert "01 voltage, 02 current" in said
    assert "10 connection" in said


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("start", "bay-1", "--all"), "start: name bays, or --all, not more than one of these"),
        (("start",), "start: name bays, or --all\n"),
        (("reset", "bay-1", "--port", "/dev/x"), "reset: name bays, or --all, or --port, not more than one of these"),
    ],
)
def test_a_request_is_for_bays_or_for_all(
    arguments: tuple[str, ...], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    assert says in capsys.readouterr().err


def test_where_no_station_file_is_one_is_asked_for(tmp_path: Path) -> None:
    command = (sys.executable, "-m", "orchestrator", "run")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "orchestrator: run: there is no station.yaml in this directory: name the station file, orchestrator run FILE\n"
    )


@pytest.mark.parametrize("text", ["station: x\nbays: []\n", "{}\n", '{"kind": "snapshot"}\n'])
def test_what_is_no_journal_is_said_to_be_none(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "station.yaml"
    file.write_text(text, encoding="utf-8")
    assert main(["replay", str(file)]) == 1
    said, told = capsys.readouterr()
    assert "JSONDecodeError" not in said
    assert "KeyError" not in said
    assert "there is no journal in these files" in told
    assert "journal.snapshots" not in told
