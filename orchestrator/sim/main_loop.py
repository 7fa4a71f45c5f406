"""How a microcontroller takes frames from its bus: not when they come, but when its main loop comes round to them."""

import random
from collections.abc import Callable

from orchestrator.sim.timers import Timers

#: A loop that does other things, too: measuring, balancing, writing to flash.
LATEST_S = 0.020


class MainLoop:
    """Whatever came since the last round is done at the next one, in its order; the same seed, the same rounds."""

    def __init__(self, timers: Timers, seed: int, latest_s: float = LATEST_S) -> None:
        self._timers = timers
        self._random = random.Random(seed)  # noqa: S311 - jitter, no secret
        self._latest_s = latest_s
        self._waiting: list[tuple[Callable[[int, bytes], None], int, bytes]] = []

    def take(self, handler: Callable[[int, bytes], None], cob_id: int, data: bytes) -> None:
        """Have the frame handled in the next round."""
        if not self._waiting:
            self._timers.call_later(self._random.uniform(0.0, self._latest_s), self._round)
        self._waiting.append((handler, cob_id, data))

    def _round(self) -> None:
        waiting, self._waiting = self._waiting, []
        for handler, cob_id, data in waiting:
            handler(cob_id, data)
