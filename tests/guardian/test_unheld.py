"""The ports of a station whose controller could not hand them over."""

import threading
from pathlib import Path

import pytest

from orchestrator.lastresort.unheld import unheld_ports

STATION = "bays:\n  - {name: bay-1, charger: {port: /dev/ttyOne}}\n  - {name: bay-2, charger: {port: /dev/ttyTwo}}\n"


@pytest.fixture(name="station")
def _station(tmp_path: Path) -> str:
    file = tmp_path / "station.yaml"
    file.write_text(STATION, encoding="utf-8")
    return str(file)


def test_those_that_are_held_are_left_out(station: str) -> None:
    assert list(unheld_ports(station, ())) == ["/dev/ttyOne", "/dev/ttyTwo"]
    assert list(unheld_ports(station, ["/dev/ttyOne"])) == ["/dev/ttyTwo"]


def test_they_are_found_without_a_thread(station: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_thread(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", no_thread)
    assert list(unheld_ports(station, ())) == ["/dev/ttyOne", "/dev/ttyTwo"]


def test_a_station_that_cannot_be_read_is_told(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert not unheld_ports(str(tmp_path / "none.yaml"), ())
    assert "CHECK EVERY CHARGER" in capfd.readouterr().err
