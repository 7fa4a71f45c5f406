"""Notices that this process stood still: what was pressed before that must not set anything going after it."""

import asyncio
import time
from collections.abc import Callable
from math import inf

#: How often the pulse beats, how long a gap means that the process stood still, and how long that counts afterwards.
TICK_S, GAP_S, AFTER_S = 0.25, 2.0, 2.0


def awake_or_asleep_s() -> float:
    """Monotonic seconds that go on while the machine is suspended."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class Pulse:
    """Beats in the event loop; any thread may ask."""

    def __init__(self, clock: Callable[[], float] = awake_or_asleep_s) -> None:
        self._clock = clock
        self._beat_s, self._stood_s = clock(), -inf
        self._task: asyncio.Task[None] | None = None

    def begin(self) -> None:
        """Beat as long as the running loop does."""
        self._task = asyncio.get_running_loop().create_task(self._run())

    def beat(self) -> None:
        """Note that the loop goes on."""
        now_s = self._clock()
        if now_s - self._beat_s > GAP_S:
            self._stood_s = now_s
        self._beat_s = now_s

    @property
    def stood_still(self) -> bool:
        """Whether the process stood still a moment ago, even if it has not beaten since."""
        beat_s, now_s = self._beat_s, self._clock()
        return now_s - beat_s > GAP_S or now_s - self._stood_s < AFTER_S

    async def _run(self) -> None:
        while True:
            self.beat()
            await asyncio.sleep(TICK_S)
