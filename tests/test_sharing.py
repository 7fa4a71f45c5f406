"""Files are shared out by kind, and in their order."""

import os
import signal
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.conftest import ENDS, LONG, pytest_runtest_setup
from tests.sharing import NICE, WAITING, Sharing, give_way, pytest_runtest_logstart

ROOT = Path(__file__).resolve().parent.parent
FILES = ("tests/whole/a.py", "tests/core/b.py", "tests/guardian/c.py", "tests/whole/d.py", "tests/proof/e.py")
#: Of each file; a worker with no more than two left gets the next file.
TESTS = 3


@pytest.fixture(autouse=True)
def _two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})


class Worker:
    """What a scheduler sees of one."""

    def __init__(self, name: str) -> None:
        self.gateway, self.shutting_down = SimpleNamespace(id=name), False
        self.files: list[str] = []
        self.to_do: list[int] = []

    def send_runtest_some(self, tests: list[int]) -> None:
        self.to_do += tests
        self.files.append(FILES[tests[0] // TESTS])

    def shutdown(self) -> None:
        self.shutting_down = True


def sharing(*workers: Worker) -> Any:
    config: Any = SimpleNamespace(
        getvalue=lambda _: ["popen"] * len(workers), option=SimpleNamespace(loadscopereorder=False)
    )
    made: Any = Sharing(config)
    for worker in workers:
        made.add_node(worker)
        made.add_node_collection(worker, [f"{file}::test_{number}" for file in FILES for number in range(TESTS)])
    made.schedule()
    return made


def test_each_gets_files_of_its_kind_in_their_order_and_then_what_is_left() -> None:
    computing, also, waiting = workers = [Worker(name) for name in ("gw0", "gw1", "gw2")]
    shared = sharing(*workers)
    assert [worker.files for worker in workers] == [["tests/core/b.py"], ["tests/proof/e.py"], ["tests/whole/a.py"]]
    shared.mark_test_complete(waiting, waiting.to_do.pop(0))
    assert waiting.files[1:] == ["tests/guardian/c.py"]
    shared.mark_test_complete(computing, computing.to_do.pop(0))
    assert computing.files[1:] == ["tests/whole/d.py"]
    shared.mark_test_complete(also, also.to_do.pop(0))
    assert also.shutting_down


def test_of_two_workers_on_two_cores_one_waits() -> None:
    computing, waiting = workers = [Worker(name) for name in ("gw0", "gw1")]
    sharing(*workers)
    assert (computing.files, waiting.files) == (["tests/core/b.py"], ["tests/whole/a.py"])


def test_one_worker_gets_everything() -> None:
    alone = Worker("gw0")
    sharing(alone)
    assert alone.files == ["tests/whole/a.py"]


@pytest.fixture(name="made_nicer_by")
def _made_nicer_by(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    by: list[int] = []
    monkeypatch.setattr(os, "nice", by.append)
    return by


@pytest.mark.parametrize(
    ("worker", "files", "nice"),
    [("gw0", FILES[1:2] * 2, [NICE]), ("gw2", FILES[:1], []), ("gw2", FILES[:2], [NICE]), (None, FILES, [])],
)
def test_who_computes_gives_way_once(
    worker: str | None,
    files: tuple[str, ...],
    nice: list[int],
    made_nicer_by: list[int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("tests.sharing.give_way", cache(give_way.__wrapped__))  # this worker's own stays done
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)
    if worker is not None:
        monkeypatch.setenv("PYTEST_XDIST_WORKER", worker)
    for file in files:
        pytest_runtest_logstart(f"{file}::test")
    assert made_nicer_by == nice


@pytest.mark.parametrize("name", WAITING)
def test_what_waits_is_there(name: str) -> None:
    assert (ROOT / name).exists()


def test_what_is_long_is_there() -> None:
    assert [name for name in LONG if not any((place / name).exists() for place in (ROOT, ROOT / "tests"))] == []


def test_no_test_leaves_signals_to_the_next_that_its_processes_would_not_hear() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDS)
    pytest_runtest_setup()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ()) & set(ENDS)
