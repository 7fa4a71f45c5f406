"""Processes of this machine, for what takes long."""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context


def cores(
    jobs: int | None = None, begin: Callable[..., object] | None = None, *arguments: object
) -> ProcessPoolExecutor:
    """So many processes; None: one for each core. Each calls `begin` with the arguments first."""
    count = jobs or len(os.sched_getaffinity(0))
    return ProcessPoolExecutor(count, get_context("spawn"), begin and partial(begin, *arguments))
