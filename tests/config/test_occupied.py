"""Names at which the service could create nothing, because something else has them."""

import json
import socket
from pathlib import Path

import pytest

from orchestrator.cli import main
from tests.whole.station import station_document


def checked(directory: Path, control: str, journal: str) -> int:
    document = station_document(directory, [{"interface": "virtual", "channel": "none"}], 1)
    document["control"]["socket"], document["journal"]["directory"] = control, journal
    file = directory / "station.yaml"
    file.write_text(json.dumps(document, indent=1), encoding="utf-8")
    return main(["check", str(file)])


def errors(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return [line for line in capsys.readouterr().err.splitlines() if ": error: " in line]


@pytest.mark.parametrize(
    ("control", "journal", "said"),
    [
        (
            "there",
            "journal",
            "error: control.socket: {}/there is a directory, where the service would create its socket",
        ),
        ("file", "journal", "error: control.socket: {}/file is a file, where the service would create its socket"),
        ("file/socket", "journal", "error: control.socket: {}/file is a file, where a directory is needed"),
        ("socket", "file", "error: journal.directory: {}/file is a file, where a directory is needed"),
        ("socket", "file/a/b", "error: journal.directory: {}/file is a file, where a directory is needed"),
    ],
)
def test_a_name_that_something_else_has_is_an_error_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], control: str, journal: str, said: str
) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "file").touch()
    assert checked(tmp_path, control, journal) == 1
    (line,) = errors(capsys)
    at, text = line.split(": ", 1)
    name, number = at.rsplit(":", 1)
    lines = Path(name).read_text(encoding="utf-8").splitlines()
    assert text.split(": ")[1].rpartition(".")[2] in lines[int(number) - 1]
    assert text.startswith(said.format(tmp_path))


def test_what_the_service_itself_has_made_is_no_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "journal").mkdir()
    with socket.socket(socket.AF_UNIX) as ours:
        ours.bind(str(tmp_path / "s"))
        assert checked(tmp_path, "s", "journal") == 0
    assert checked(tmp_path, "not/yet/s", "not/yet/journal") == 0
    assert errors(capsys) == []


def test_a_station_without_errors_is_told_how_far_back_its_journal_will_reach(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert checked(tmp_path, "socket", "journal") == 0
    told = capsys.readouterr().out
    assert told.count("journal: with the bay charging day and night, ") == 1
