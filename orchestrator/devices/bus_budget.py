"""The share of a CAN bus that our SDO reads may take, and its distribution.

An exchange is two frames of 8 bytes with an 11-bit id. Such a frame has 111 bits including the pause after it, of which
98 are subject to stuffing: at worst 24 bits more. Two frames are 270 bits, so 30 % of 250 kbit/s is 277 exchanges per
second.
"""

from dataclasses import dataclass

FRAME_BITS = 111 + 24
EXCHANGE_BITS = 2 * FRAME_BITS
SHARE = 0.30  #: the maximum share of the bus's bit rate for SDO traffic
PLANNED = 0.9  #: the part of that share planned for sweeps: without slack the queue would only grow
BURST = 4  #: exchanges that may follow each other at once; below the 10 frames in SocketCAN's queue
SLOW_S = 1.0  #: how often the slow objects are read
#: On an overloaded bus, the slow objects first yield to this: their values may be 3 s old, the fast ones' 1.5 s.
YIELDING_SLOW_S = 2.0
#: Three sweeps within the 1.5 s allowed for a fast value: if a sweep takes longer, the slow objects yield.
GOOD_SWEEP_S = 0.5


@dataclass(frozen=True, slots=True)
class _Share:
    fast: int
    slow: int
    sweep_s: float


class BusBudget:
    """Shares a bus between its nodes: stretches all sweeps by one factor, and spaces the requests."""

    def __init__(self, bitrate: int) -> None:
        self.capacity_hz = SHARE * bitrate / EXCHANGE_BITS
        self._shares: list[_Share] = []
        self._stretch = 1.0
        self._slow_s = SLOW_S
        self._least_s = 0.0  # the period of every object, if even that is too much
        self._spacing_s = 1.0 / self.capacity_hz
        self._next_s = float("-inf")  # when all reservations are used up

    def join(self, fast: int, slow: int, sweep_s: float) -> None:
        """Add a node with this many fast and slow objects, the fast ones every `sweep_s`. All sweeps may stretch."""
        self._shares.append(_Share(fast, slow, sweep_s))
        longest_s = max(share.sweep_s for share in self._shares)
        self._stretch = self._stretched(SLOW_S)
        if self._stretch * longest_s > GOOD_SWEEP_S:
            self._slow_s = YIELDING_SLOW_S
            self._stretch = self._stretched(YIELDING_SLOW_S)
        if self._stretch * longest_s > YIELDING_SLOW_S:
            objects = sum(share.fast + share.slow for share in self._shares)
            self._least_s = objects / (PLANNED * self.capacity_hz)

    def _stretched(self, slow_s: float) -> float:
        """The factor for the fast objects' sweeps if the slow ones are read every `slow_s`."""
        fast_hz = sum(share.fast / share.sweep_s for share in self._shares)
        left_hz = PLANNED * self.capacity_hz - sum(share.slow for share in self._shares) / slow_s
        return max(1.0, fast_hz / left_hz) if left_hz > 0 else float("inf")

    def fast_s(self, sweep_s: float) -> float:
        """How often a fast object with the period `sweep_s` may be read."""
        return self._least_s or sweep_s * self._stretch

    @property
    def slow_s(self) -> float:
        """How often a slow object may be read."""
        return max(self._slow_s, self._least_s)

    def reserve(self, now_s: float) -> float:
        """Reserve one exchange, and return when it may begin: now, or after the earlier reservations.

        Reservations are served in order, so that no node is ever passed over.
        """
        begin_s = max(now_s, self._next_s - (BURST - 1) * self._spacing_s)
        self._next_s = max(now_s, self._next_s) + self._spacing_s
        return begin_s
