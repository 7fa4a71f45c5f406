"""Sweeps over policy keys: every combination, on all cores or a cluster, with messages for invalid ones."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest
from distributed import LocalCluster
from PIL import Image

from orchestrator.config.load import load_scenario
from orchestrator.errors import ConfigError, UsageError
from orchestrator.workbench.draw.present import save_sweep
from orchestrator.workbench.processes import cores
from orchestrator.workbench.simulate.figures import Figures
from orchestrator.workbench.simulate.simulation import UnsuitableError
from orchestrator.workbench.simulate.sweep import (
    Axis,
    ClusterError,
    Point,
    Sweep,
    as_table,
    axis,
    best,
    cluster,
    played,
    rows,
)

FINISH = Axis(("finish.target_soc_pct",), ("80", "97", "100"))
DEEP = load_scenario("deep-discharge")
STEP = Axis(("current.temperature_c.rows[2].max_a",), ("8", "14"))


@pytest.fixture(scope="module")
def swept() -> Sweep:
    with cores(2) as pool:
        return played("li-ion-48v", DEEP, [FINISH, STEP], pool, lambda *_: None)


def test_every_combination_is_played_in_order(swept: Sweep) -> None:
    assert [point.values for point in swept.points] == [(f, s) for f in FINISH.values for s in STEP.values]
    assert (swept.policy, swept.scenario) == ("li-ion-48v", "deep-discharge")


def test_the_values_are_what_the_policy_goes_by(swept: Sweep) -> None:
    found = {point.values: point.figures for point in swept.points}
    full, gentle = found["100", "14"], found["100", "8"]
    assert full is not None
    assert gentle is not None
    assert full.full_h is not None
    assert gentle.full_h is not None
    assert full.peak_c is not None
    assert gentle.peak_c is not None
    assert full.full_h < gentle.full_h
    assert full.peak_c > gentle.peak_c


def test_what_the_policy_may_not_have_is_refused_with_its_line(swept: Sweep) -> None:
    refused = [point for point in swept.points if point.values[0] == "80"]
    assert all(point.figures is None for point in refused)
    assert refused[0].refused.startswith("policies/li-ion-48v.yaml:26:18: error: start.soc_below_pct: 98 % is above")
    assert [row[2] for row in rows(swept)[1:3]] == ["refused: 1", "refused: 1"]
    assert as_table(swept).splitlines()[len(rows(swept))] == f"refused: 1: {refused[0].refused}"
    assert all(len(line) <= 60 for line in as_table(swept, 60).splitlines())


def test_a_table_has_all_points_below_its_head(swept: Sweep) -> None:
    head, *lines = rows(swept)
    assert head[:3] == ["finish.target_soc_pct", "current.temperature_c.rows[2].max_a", "time to full, h:min"]
    assert [line[:2] for line in lines] == [list(point.values) for point in swept.points]
    assert {len(line) for line in lines} == {len(head)}


def test_a_sweep_becomes_a_picture_and_a_file_of_numbers(swept: Sweep, tmp_path: Path) -> None:
    png, numbers = save_sweep(swept, tmp_path)
    with Image.open(png) as picture:
        assert picture.format == "PNG"
    with numbers.open(encoding="utf-8") as file:
        records = list(csv.DictReader(file))
    assert [record["finish.target_soc_pct"] for record in records] == [point.values[0] for point in swept.points]
    assert records[0]["full_h"] == ""
    assert float(records[-1]["full_h"]) == swept.points[-1].figures.full_h  # type: ignore[union-attr]  # it has


def test_a_cluster_finds_what_the_cores_find(swept: Sweep) -> None:
    one_worker = {"n_workers": 1, "processes": False, "dashboard_address": None}
    with LocalCluster(**one_worker) as local:  # type: ignore[no-untyped-call]  # it has no annotations
        address = local.scheduler_address
        with cluster(address) as pool:
            found = played("li-ion-48v", DEEP, [FINISH, STEP], pool, lambda *_: None)
    assert found == swept


def test_a_cluster_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orchestrator.workbench.simulate.sweep.CONNECT_S", 0.2)
    with pytest.raises(ClusterError, match="no cluster answers there"), cluster("tcp://127.0.0.1:9"):
        pass


def test_it_says_how_far_it_is() -> None:
    shares: list[float] = []
    with cores(1) as pool:
        played("li-ion-48v", DEEP, [STEP], pool, lambda _, share: shares.append(share))
    assert shares == [0.5, 1.0]


@pytest.mark.parametrize(
    ("text", "keys", "values"),
    [
        ("finish.soc_pct=80..100:5", ("finish.soc_pct",), ("80", "85", "90", "95", "100")),
        ("a[0].to,a[1].from=-1.5..0:2", ("a[0].to", "a[1].from"), ("-1.5", "0")),
        ("a=0..1:4", ("a",), ("0", "0.333333", "0.666667", "1")),
    ],
)
def test_an_axis_is_read(text: str, keys: tuple[str, ...], values: tuple[str, ...]) -> None:
    assert axis(text) == Axis(keys, values)


@pytest.mark.parametrize(
    "text", ["", "a", "a=1", "a=1..2", "a=1..b:3", "a=1.2.3..4:2", "=1..2:3", "a=1..2:1", "a=1..2:999999"]
)
def test_what_is_no_axis_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--sweep"):
        axis(text)


@pytest.mark.parametrize(
    ("policy", "error"),
    [
        ("li-ion-24v", UnsuitableError),
        ("li-ion-48", ConfigError),
    ],
)
def test_what_is_wrong_from_the_beginning_is_said_before_anything_is_played(
    policy: str, error: type[Exception]
) -> None:
    with cores(1) as pool, pytest.raises(error):
        played(policy, DEEP, [STEP], pool, lambda *_: None)


def test_too_many_points_are_refused() -> None:
    many = Axis(("finish.soc_pct",), tuple(map(str, range(1000))))
    with cores(1) as pool, pytest.raises(UsageError, match="1000000 combinations"):
        played("li-ion-48v", DEEP, [many, many], pool, lambda *_: None)


def test_the_best_points_are_those_that_no_other_beats() -> None:
    plain = Figures("p", 1, 1, 3.0, 99.0, 1.0, 1.0, 30.0, 1.0, 0, 0, {})

    def point(name: str, **changes: float | None) -> Point:
        return Point((name,), replace(plain, **changes))  # type: ignore[arg-type]  # fields of Figures

    fast, cool = point("fast", full_h=2.0, peak_c=35.0), point("cool", full_h=4.0, peak_c=25.0)
    worse, never = point("worse", full_h=4.0, peak_c=31.0), point("never", full_h=None, peak_c=20.0)
    assert best([fast, cool, worse, never, Point(("x",), None, "refused")]) == [fast, cool]
