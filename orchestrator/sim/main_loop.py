"""How a microcontroller handles frames from its bus: not on arrival, but when its main loop gets to them."""

import random
from collections.abc import Callable

from orchestrator.sim.timers import Timers

#: The longest round of a loop that also measures, balances and writes to flash.
LATEST_S = 0.020


class MainLoop:
    """Handles everything that arrived since the last round at the next one, in order; same seed, same rounds."""

    def __init__(self, timers: Timers, seed: int, latest_s: float = LATEST_S) -> None:
        self._timers = timers
        self._random = random.Random(seed)  # noqa: S311 - jitter, not a secret
        self._latest_s = latest_s
        self._waiting: list[tuple[Callable[[int, bytes], None], int, bytes]] = []

    def take(self, handler: Callable[[int, bytes], None], cob_id: int, data: bytes) -> None:
        """Queue the frame for the next round."""
        if not self._waiting:
            self._timers.call_later(self._random.uniform(0.0, self._latest_s), self._round)
        self._waiting.append((handler, cob_id, data))

    def _round(self) -> None:
        waiting, self._waiting = self._waiting, []
        for handler, cob_id, data in waiting:
            handler(cob_id, data)
