"""The benchmarks still run. Their results are not tested: numbers depend on the machine."""

import json
import subprocess
import sys
from argparse import ArgumentTypeError
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from benchmarks import bare, before, gateway, naive, startup
from benchmarks.__main__ import PARTS
from benchmarks.report import Goal, Result, Series, table
from orchestrator.protocol.charger import OPERATION_STOP_FRAME, STATUS_KINDS, STOP_FRAME, status_request

ROOT = Path(__file__).resolve().parent.parent


#: Quick parts, and a row of each.
QUICK = {
    "gateway": "a fixed piece of Python, for the gateway factor",
    "step": "step(), charging",
    "decoder": "decoder, clean frames, one a read",
    "simulate": "simulate, a charge of 4 h",
    "can": "CAN thread, a read of 960/s, socketcan",
}


@dataclass(frozen=True)
class Run:
    """One run of the quick parts, in which each process measures the gateway factor once."""

    printed: str
    figures: Path

    @property
    def document(self) -> dict[str, Any]:
        return dict(json.loads(self.figures.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def quick_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    figures = tmp_path_factory.mktemp("benchmarks") / "figures.json"
    parts = (word for part in QUICK for word in ("--only", part))
    command = [sys.executable, "-m", "benchmarks", "--quick", *parts, "--json", str(figures)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=110, check=True)
    return Run(run.stdout, figures)


@pytest.mark.parametrize("part", [part for part in QUICK if part != "gateway"])
def test_a_quick_part_prints_a_table_and_writes_the_figures(part: str, quick_run: Run) -> None:
    row, document = QUICK[part], quick_run.document
    assert row in quick_run.printed
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


def test_the_gateway_factor_is_at_the_top_of_every_table_and_an_earlier_run_beside_it(quick_run: Run) -> None:
    machine = quick_run.document["machine"]
    assert machine["gateway_factor"] > 0
    assert quick_run.printed.partition("\n")[0].endswith(f", gateway factor {machine['gateway_factor']}")
    assert "change" not in quick_run.printed
    command = [sys.executable, "-m", "benchmarks", "--quick", "--only", "gateway", "--before", str(quick_run.figures)]
    second = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=110, check=True)
    heading, row = second.stdout.splitlines()[1:]
    assert heading.split()[-2:] == ["before", "change"]
    assert row.startswith("a fixed piece of Python") and row.endswith(" %")


def test_the_gateway_is_the_first_part() -> None:
    assert next(iter(PARTS)) == "gateway"


def test_the_work_of_the_gateway_factor_stays_as_it_was() -> None:
    # With other work, no factor could be compared with an earlier one.
    assert gateway.work() == gateway.Total(replies=11_000, ampere_s=50842.0000000088, changes=11_007)


def test_the_gateway_factor_is_of_the_best_run(monkeypatch: pytest.MonkeyPatch) -> None:
    reference_ms = gateway.REFERENCE_MS
    monkeypatch.setattr(gateway, "times_ms", lambda: (3 * reference_ms, 2 * reference_ms, 9 * reference_ms))
    assert gateway.factor() == 2.0


def _document(**medians: float | None) -> dict[str, Any]:
    rows = [{"what": what, "unit": "ms", "ours": {"median": median}} for what, median in medians.items()]
    return {"machine": {"gateway_factor": 2.0}, "results": rows}


def _file(directory: Path, document: object) -> str:
    path = directory / "before.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return str(path)


def _result(what: str, *samples: float, unit: str = "ms", processor_time: bool = False) -> Result:
    return Result(what, unit, Series("ours", samples), processor_time=processor_time)


def test_earlier_processor_times_are_scaled_to_this_machine_and_nothing_else(tmp_path: Path) -> None:
    earlier = before.load(_file(tmp_path, _document(cpu=10.0, wait=10.0)))
    results = [_result("cpu", 12.0, processor_time=True), _result("wait", 12.0)]
    assert list(earlier.columns(results, 4.0)) == [("before", "change"), ("20 ms", "−40 %"), ("10 ms", "+20 %")]


def test_what_cannot_be_compared_has_no_change(tmp_path: Path) -> None:
    earlier = before.load(_file(tmp_path, _document(never=None, nothing=0.0, other=1.0, none=1.0)))
    results = [
        _result("never", 1.0), _result("nothing", 1.0), _result("new", 1.0), _result("other", 1.0, unit="s"),
        _result("none"),
    ]  # fmt: skip
    assert list(earlier.columns(results, 1.0))[1:] == [
        ("never", ""), ("0 ms", ""), ("", ""), ("", ""), ("1 ms", ""),
    ]  # fmt: skip
    assert table(results, list(earlier.columns(results, 1.0))).partition("\n")[0].split()[-2:] == ["before", "change"]


def test_the_earlier_run_in_the_repository_can_be_put_beside() -> None:
    earlier = before.load(str(ROOT / "benchmarks" / "before.json"))
    assert earlier.medians["CPU, 64 bays, 1 bus", "%"]


@pytest.mark.parametrize(
    ("content", "wrong"),
    [
        (b"{", "is not JSON"),
        (b"\xff", "is not JSON"),
        (b"[" * 100_000, "is not JSON"),
        (b"[]", "has another form"),
        (b"null", "has another form"),
        (b'{"machine": {"gateway_factor": 1.0}}', "has another form"),
        (b'{"machine": {"gateway_factor": 0}, "results": []}', "has another form"),
        (b'{"machine": {"gateway_factor": NaN}, "results": []}', "has another form"),
        (b'{"machine": {"gateway_factor": "1"}, "results": []}', "has another form"),
        (b'{"machine": {"gateway_factor": 1.0}, "results": [{"what": "x", "unit": "s"}]}', "has another form"),
        (
            b'{"machine": {"gateway_factor": 1.0}, "results": [{"what": "x", "unit": "s", "ours": {"median": "1"}}]}',
            "has another form",
        ),
        (b'{"machine": {"cores": 2}, "results": []}', "is from an older version, without a gateway_factor"),
    ],
)
def test_a_file_of_another_kind_is_refused_with_a_sentence(content: bytes, wrong: str, tmp_path: Path) -> None:
    path = tmp_path / "before.json"
    path.write_bytes(content)
    with pytest.raises(ArgumentTypeError) as refused:
        before.load(str(path))
    assert str(refused.value) == f"{path} {wrong}; {before.EXPECTED}"


@pytest.mark.parametrize(
    ("option", "name", "wrong"),
    [
        ("--before", "nowhere.json", f"cannot be read (No such file or directory); {before.EXPECTED}"),
        ("--before", ".", f"cannot be read (Is a directory); {before.EXPECTED}"),
        ("--json", "nowhere/figures.json", "cannot be written (No such file or directory)"),
    ],
)
def test_a_file_that_is_of_no_use_is_said_before_anything_is_measured(
    option: str, name: str, wrong: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    command = [sys.executable, "-m", "benchmarks", option, str(path)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 2 and not run.stdout and "Traceback" not in run.stderr
    assert run.stderr.endswith(f"error: argument {option}: {path} {wrong}\n")
