"""The share of a CAN bus that our SDO reads may take, and its distribution.

An exchange is two frames of 8 bytes with an 11-bit id. Such a frame has 111 bits including the pause after it, of which
98 are subject to stuffing: at worst 24 bits more. Two frames are 270 bits, so 30 % of 250 kbit/s is 277 exchanges per
second.

What can change within 100 ms is read every sweep, but only from a node that is watched closely: current flows, or a
charge is about to begin. Temperature, SOC and SOH do not change that fast, and nothing does while a battery rests.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from orchestrator.protocol.objects import Sweep

FRAME_BITS = 111 + 24
EXCHANGE_BITS = 2 * FRAME_BITS
SHARE = 0.30  #: the maximum share of the bus's bit rate for SDO traffic
PLANNED = 0.9  #: the part of that share planned for sweeps: without slack the queue would only grow
BURST = 4  #: exchanges that may follow each other at once; below the 10 frames in SocketCAN's queue
#: A bus is served in ticks, so that requests to several nodes, and their answers, share a wake-up. No round period is a
#: multiple of a tick: otherwise our requests would collide with those of a master that reads every 30 ms, say.
TICK_S = 0.0047
TICKS = (4, 2)  #: this many ticks are joined to one if …
PER_TICK = 5  #: … at most this many exchanges begin in it, so that the queue has room for twice as many, …
PER_SWEEP = 10  #: … and a sweep has this many: no value becomes much older by it


@dataclass(frozen=True, slots=True)
class Periods:
    """The periods of objects that are not read every sweep."""

    medium_s: float
    slow_s: float
    rest_s: float | None  #: the fast objects of a node at rest; None: every sweep, as those of the others


#: A third of the age at which each value goes stale: one lost answer makes none stale.
USUAL = Periods(medium_s=0.5, slow_s=1.0, rest_s=0.5)
#: On an overloaded bus, values may be 1.5 s old, those of the slow objects 3 s.
YIELDING = Periods(medium_s=1.0, slow_s=2.0, rest_s=1.0)
#: If that is still too much, no node at rest is read more often than those watched closely.
ALIKE = Periods(medium_s=1.0, slow_s=2.0, rest_s=None)
#: Tried in this order, each with the longest sweep acceptable for it: three sweeps within the 1.5 s that a fast value
#: may be old; no longer than at rest; no longer than the slow objects' period.
PLANS = ((USUAL, 0.5), (YIELDING, 1.0), (ALIKE, 2.0))


@dataclass(slots=True)
class Share:
    """One node's objects of each kind, and whether it is watched closely."""

    counts: Mapping[Sweep, int]
    sweep_s: float
    closely: bool = True

    def fast_hz(self, periods: Periods) -> float:
        """Reads per second of the objects wanted every sweep."""
        sweeps = self.closely or periods.rest_s is None
        return self.counts[Sweep.FAST] / self.sweep_s if sweeps else 0.0

    def other_hz(self, periods: Periods) -> float:
        """Reads per second of all other objects."""
        seldom_hz = self.counts[Sweep.MEDIUM] / periods.medium_s + self.counts[Sweep.SLOW] / periods.slow_s
        if self.closely or periods.rest_s is None:
            return seldom_hz
        return seldom_hz + self.counts[Sweep.FAST] / periods.rest_s


class BusBudget:
    """Shares a bus between its nodes: stretches all sweeps by one factor, and spaces the requests."""

    def __init__(self, bitrate: int) -> None:
        self.capacity_hz = SHARE * bitrate / EXCHANGE_BITS
        self._shares: list[Share] = []
        self._stretch = 1.0
        self._periods = USUAL
        self._least_s = 0.0  # the period of every object, if even that is too much
        self.tick_s = TICK_S  #: how often the bus is served
        self._spacing_s = 1.0 / self.capacity_hz
        self._next_s = float("-inf")  # when all reservations are used up

    def join(self, counts: Mapping[Sweep, int], sweep_s: float) -> Share:
        """Add a node with this many objects of each kind, the fast ones every `sweep_s`. All sweeps may stretch."""
        share = Share(counts, sweep_s)
        self._shares.append(share)
        self._plan()
        return share

    def watch(self, share: Share, *, closely: bool) -> None:
        """Watch this node closely from now on, or no longer; the others get what that frees."""
        share.closely = closely
        self._plan()

    def _plan(self) -> None:
        longest_s, self._least_s = max(share.sweep_s for share in self._shares), 0.0
        for periods, good_s in PLANS:
            self._periods, self._stretch = periods, self._stretched(periods)
            if self._stretch * longest_s <= good_s:
                break
        else:
            objects = sum(sum(share.counts.values()) for share in self._shares)
            self._least_s = objects / (PLANNED * self.capacity_hz)
        self.tick_s = self._longest_tick_s()

    def _longest_tick_s(self) -> float:
        periods = self._periods
        reads_hz = sum(share.fast_hz(periods) / self._stretch + share.other_hz(periods) for share in self._shares)
        sweep_s = min(self.period_s(share, Sweep.FAST) for share in self._shares)
        longest_s = min(PER_TICK / min(reads_hz, self.capacity_hz), sweep_s / PER_SWEEP)
        return next((ticks * TICK_S for ticks in TICKS if ticks * TICK_S <= longest_s), TICK_S)

    def _stretched(self, periods: Periods) -> float:
        """The factor for the sweeps if everything else is read this often."""
        fast_hz = sum(share.fast_hz(periods) for share in self._shares)
        left_hz = PLANNED * self.capacity_hz - sum(share.other_hz(periods) for share in self._shares)
        return max(1.0, fast_hz / left_hz) if left_hz > 0 else float("inf")

    def period_s(self, share: Share, sweep: Sweep) -> float:
        """How often an object of this node may be read."""
        if self._least_s:
            return self._least_s
        if sweep is not Sweep.FAST:
            return self._periods.medium_s if sweep is Sweep.MEDIUM else self._periods.slow_s
        if share.closely or self._periods.rest_s is None:
            return share.sweep_s * self._stretch
        return self._periods.rest_s

    def reserve(self, now_s: float) -> float:
        """Reserve one exchange, and return when it may begin: now, or after the earlier reservations.

        Reservations are served in order, so that no node is ever passed over.
        """
        begin_s = max(now_s, self._next_s - (BURST - 1) * self._spacing_s)
        self._next_s = max(now_s, self._next_s) + self._spacing_s
        return begin_s
