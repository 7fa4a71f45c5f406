"""The share of a line's exchanges that failed in the last minute."""

from collections import deque

WINDOW_S = 60.0
#: Fewer exchanges than this say nothing about the line.
LEAST = 50


class LineQuality:
    """Counts each poll once, as good or bad."""

    __slots__ = ("_bad", "_exchanges")

    def __init__(self) -> None:
        self._exchanges: deque[tuple[float, bool]] = deque()  # (when, failed)
        self._bad = 0

    def count(self, now_s: float, *, bad: bool) -> None:
        """One exchange is over."""
        self._exchanges.append((now_s, bad))
        self._bad += bad
        while now_s - self._exchanges[0][0] > WINDOW_S:
            self._bad -= self._exchanges.popleft()[1]

    @property
    def bad_pct(self) -> float:
        """The share that failed; 0 while there are too few exchanges."""
        count = len(self._exchanges)
        return round(100 * self._bad / count, 1) if count >= LEAST else 0.0
