"""Work that would hold up the event loop, in threads: few of each kind, and no more waiting than can be done soon."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

from orchestrator.model import Cause
from orchestrator.northbound.refusal import RefusalError

P = ParamSpec("P")
T = TypeVar("T")


class Workers:
    """Threads for one kind of work. Another kind never waits for them."""

    def __init__(self, name: str, threads: int, waiting: int) -> None:
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix=name)
        self._most, self._now = threads + waiting, 0

    async def do(self, what: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Do it there; RefusalError if too much is waiting already."""
        if self._now >= self._most:
            raise RefusalError(503, Cause("page_busy"), {"retry-after": "2"})
        self._now += 1
        loop = asyncio.get_running_loop()
        future = self._pool.submit(what, *args, **kwargs)
        future.add_done_callback(lambda _: loop.call_soon_threadsafe(self._done))
        return await asyncio.wrap_future(future)

    def _done(self) -> None:
        self._now -= 1
