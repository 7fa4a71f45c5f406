"""The benchmarks still run. Their results are not tested: numbers depend on the machine."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import bare, naive, startup
from benchmarks.report import Goal, Result, Series, table
from orchestrator.protocol.charger import OPERATION_STOP_FRAME, STATUS_KINDS, STOP_FRAME, status_request

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize(
    ("part", "row"),
    [
        ("step", "step(), charging"),
        ("decoder", "decoder, clean frames, one a read"),
        ("simulate", "simulate, a charge of 4 h"),
        ("can", "CAN thread, a read of 960/s, socketcan"),
    ],
)
def test_a_quick_part_prints_a_table_and_writes_the_figures(part: str, row: str, tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    command = [sys.executable, "-m", "benchmarks", "--quick", "--only", part, "--json", str(figures)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=True)
    assert row in run.stdout
    document = json.loads(figures.read_text(encoding="utf-8"))
    (result,) = (result for result in document["results"] if result["what"] == row)
    assert all(result[side]["median"] > 0 and result[side]["n"] > 0 for side in ("ours", "beside"))
    assert document["machine"]["cores"] >= 1


def test_all_sides_ask_the_charger_the_same() -> None:
    request = status_request(*STATUS_KINDS)
    assert request == naive.STATUS == bare.STATUS_REQUEST
    assert request.startswith(startup.POLL) and request.hex() in startup.FLOOR.lower()
    assert naive.STOP == (STOP_FRAME, OPERATION_STOP_FRAME) and startup.STOP == STOP_FRAME


def test_p99_is_what_one_run_in_a_hundred_exceeds() -> None:
    series = Series("ours", [float(number) for number in range(200, 0, -1)])
    assert (series.median, series.p99, series.n) == (100.5, 198.0, 200)
    assert Series("ours", series.samples, more_is_better=True).p99 == 3.0


def test_runs_without_an_answer_count_as_the_slowest() -> None:
    assert Series("ours", [1.0] * 98, missing=2).p99 is None
    assert Series("ours", [1.0] * 99, missing=1).p99 == 1.0
    never = Series("naive", [], missing=8)
    assert (never.median, never.p99, never.n) == (None, None, 8)
    assert Series("naive", [1.0, 2.0], missing=1).median == 2.0
    assert Series("ours", []).median is None


def test_a_goal_may_be_any_share_of_what_is_beside_it() -> None:
    assert [Goal(share=share).text("µs") for share in (0.5, 0.8)] == ["≤ 1/2 of it", "≤ 4/5 of it"]


@pytest.mark.parametrize(
    ("goal", "met"),
    [
        (Goal(median=2.0), True),
        (Goal(median=1.9), False),
        (Goal(p99=2.9), False),
        (Goal(share=0.5), True),
        (Goal(share=0.1), False),
    ],
)
def test_goals(goal: Goal, met: bool) -> None:
    ours, naive = Series("ours", [1.0, 2.0, 3.0]), Series("naive", [4.0, 5.0, 6.0])
    assert Result("reaction", "ms", ours, naive, goal).met is met


def test_nothing_is_better_than_never() -> None:
    result = Result("reaction", "ms", Series("ours", [1.0]), Series("naive", [], missing=3), Goal(share=0.5))
    assert result.met
    assert "never" in table([result])
