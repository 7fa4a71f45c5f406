"""Processes of this machine, for what takes long."""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

from orchestrator.errors import UsageError


def cores(
    jobs: int | None = None, begin: Callable[..., object] | None = None, *arguments: object
) -> ProcessPoolExecutor:
    """So many processes; None: one for each core. Each calls `begin` with the arguments first. Raises UsageError."""
    count = len(os.sched_getaffinity(0)) if jobs is None else jobs
    if count < 1:
        raise UsageError(f"--jobs {jobs}: write 1 or more")
    return ProcessPoolExecutor(count, get_context("spawn"), begin and partial(begin, *arguments))
