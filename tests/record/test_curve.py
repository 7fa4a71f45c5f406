"""The curves of charges: points, files that survive a power cut, and how long they stay."""

import csv
import gzip
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import pytest

from orchestrator.model import Request, State
from orchestrator.record.curve import STAY, member, outdated, whole_size
from orchestrator.service.curves import Curves
from tests.record.kept import WALL_S, Kept

ID = "01M8GCS0E00BAYF3S4YG31G85B"


def rows(path: Path) -> list[Mapping[str, str]]:
    with gzip.open(path, "rt", newline="") as file:
        return list(csv.DictReader(file))


def test_a_charge_has_a_curve_over_pauses_and_restarts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Kept(tmp_path)
    monkeypatch.setattr("orchestrator.service.bay.time", kept.wall)
    kept.bench.charging()
    kept.bench.step(300)
    kept.bench.ask(Request.PAUSE)
    kept.bench.until(State.SUSPENDED)
    kept.recorder.turn()
    kept.again(kept.persisted())
    kept.bench.until(State.SUSPENDED)
    kept.bench.ask(Request.START)
    kept.bench.charging()
    kept.bench.ask(Request.STOP)
    kept.bench.until(State.HELD)
    kept.recorder.turn()
    (path,) = (tmp_path / "sessions" / "curves").iterdir()
    assert path.name == f"{kept.records()[-1]['id']}.csv.gz"
    points = rows(path)
    charging = [float(point["elapsed_s"]) for point in points if point["state"] == "CHARGING"]
    assert 6 <= len(charging) < 20
    assert max(later - before for before, later in pairwise(charging[:6])) <= 10.5
    assert [point["state"] for point in points][-1] == "HELD"
    assert points[3]["step"] == "5"
    assert points[3]["charger_a"] == "14"
    assert float(points[-1]["charger_ah"]) > float(points[3]["charger_ah"]) > 0


@pytest.mark.parametrize("torn", [0, 1, 9, 20, 40])
def test_what_is_written_behind_a_torn_end_can_be_read(tmp_path: Path, torn: int) -> None:
    Curves(tmp_path, 365.0).write(ID, "1,A\r\n", WALL_S)
    path = tmp_path / "curves" / f"{ID}.csv.gz"
    whole = path.read_bytes()
    path.write_bytes(whole + member("2,B\r\n")[:torn])
    Curves(tmp_path, 365.0).write(ID, "3,C\r\n", WALL_S)
    assert gzip.decompress(path.read_bytes()).decode().splitlines()[1:] in (["1,A", "3,C"], ["1,A", "2,B", "3,C"])


def test_only_whole_members_count() -> None:
    one = member("1,A\r\n")
    assert whole_size(b"") == 0
    assert whole_size(one) == len(one)
    assert whole_size(one + one[:-1]) == len(one)
    assert whole_size(one + b"\0\0\0") == len(one)
    assert whole_size(b"junk") == 0


def test_old_curves_go_but_the_newest_hundred_stay() -> None:
    names = [f"{number:026}.csv.gz" for number in range(STAY + 5)]
    assert outdated(names, f"{3:026}") == names[:3]
    assert outdated(names, "Z") == names[:5]
    assert outdated([*names, "notes.txt"], "Z") == names[:5]


def test_old_curves_are_removed_when_a_new_one_begins(tmp_path: Path) -> None:
    folder = tmp_path / "curves"
    folder.mkdir()
    for number in range(STAY + 5):
        (folder / f"{number:026}.csv.gz").write_bytes(b"")
    Curves(tmp_path, 365.0).write(ID, "1,A\r\n", 5.0)  # a clock that was never set
    assert len(list(folder.iterdir())) == STAY + 6
    Curves(tmp_path, 365.0).write("01M8GCS0E00BAYF3S4YG31G85C", "1,A\r\n", WALL_S)
    assert len(list(folder.iterdir())) == STAY + 1
