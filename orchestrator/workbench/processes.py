"""Local processes for long computations."""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

from orchestrator.errors import UsageError


def cores(
    jobs: int | None = None, begin: Callable[..., object] | None = None, *arguments: object
) -> ProcessPoolExecutor:
    """A pool of `jobs` processes; None: one per core. Each first calls `begin(*arguments)`. Raises UsageError."""
    count = len(os.sched_getaffinity(0)) if jobs is None else jobs
    if count < 1:
        raise UsageError(f"--jobs {jobs}: write 1 or more")
    return ProcessPoolExecutor(count, get_context("spawn"), begin and partial(begin, *arguments))
