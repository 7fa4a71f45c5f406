"""`pytest -p tests.sharing -n 6`: which worker gets which file. Some compute, one per core, and the others wait.

Tests with real processes wait most of their time and must be served at once when they do not; tests that compute can
wait at any time. So each worker takes files of its own kind, in the order of the collection, and of the other kind when
there are no more of its own. Whoever has begun to compute gives way to all other processes (`nice`): the cores are
busy from the beginning to the end, and what happens in real time hardly notices.
"""

import os
from functools import cache

import pytest
from xdist.scheduler import LoadFileScheduling

#: Files with real processes, lines and clocks: all below these names.
WAITING = ("tests/whole/", "tests/guardian/", "tests/service/", "tests/link/", "tests/test_benchmarks.py")
NICE = 10


def waits(name: str) -> bool:
    """Whether the tests of a file wait for something real most of their time."""
    return name.startswith(WAITING)


def computes(worker: str, workers: int) -> bool:
    """Whether a worker (`gw0`, `gw1`, …) begins with files that compute; at least one of several does not."""
    return int(worker.removeprefix("gw")) < min(len(os.sched_getaffinity(0)), workers - 1)


class Sharing(LoadFileScheduling):  # type: ignore[misc]  # it has no types
    """A file at a time, to workers of two kinds."""

    def _assign_work_unit(self, node: object) -> None:
        waiting = not computes(node.gateway.id, self.numnodes)  # type: ignore[attr-defined]  # as above
        own = next((scope for scope in self.workqueue if waits(scope) is waiting), None)
        if own is not None:
            self.workqueue.move_to_end(own, last=False)
        super()._assign_work_unit(node)


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> Sharing:
    """Called in the process that shares the files out."""
    return Sharing(config, log)


@cache
def give_way() -> None:
    """Once and for good: nobody but root gets a priority back."""
    os.nice(NICE)


def pytest_runtest_logstart(nodeid: str) -> None:
    """Called before each test; a worker that takes files of the other kind has seen the last of its own."""
    if "PYTEST_XDIST_WORKER" in os.environ and not waits(nodeid):
        give_way()
