"""Time that jumps, for the unchanged service: its threads run one at a time, and the clock moves when all of them wait.

A virtual thread is a greenlet. Whoever waits looks for what comes next in one queue of moments: callbacks are run on
the spot, to a thread is switched. Thus everything happens in one order, the same in every run, and an hour passes as
quickly as it can be computed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import Any

from greenlet import getcurrent, greenlet

#: A clock never shows the same time twice; that is also the time that one look at it costs.
TICK_S = 1e-6
#: More moments than this within a millisecond: somebody turns without ever waiting.
BUSY = 20_000


class StuckError(BaseException):
    """The world has been ended from outside, or can only be; no boundary of the product may swallow it."""


@dataclass(slots=True)
class Handle:
    """A callback that is still to come."""

    callback: Callable[..., object] | None
    args: tuple[object, ...]

    def cancel(self) -> None:
        self.callback = None


@dataclass(slots=True, eq=False)
class Runner:
    """One virtual thread; `turn` counts its wake-ups, so that a later one for the same wait is void."""

    let: greenlet
    process: Any = None  #: whose thread it is: a `virtual_process.Process`, or nobody's
    turn: int = 0
    ended: bool = False
    killed: bool = False  #: it never runs again, not even its clean-up, until the world itself is closed


class Time:
    """The clock, the queue of moments, whose turn it is. `call_later`, `call_soon`, `time` as in an asyncio loop."""

    def __init__(self, end_s: float = inf) -> None:
        self.now_s = 1000.0
        self.end_s = self.now_s + end_s
        self.failure: BaseException | None = None  #: what ended the world, if anything did
        self._moments: list[tuple[float, int, Handle | Runner, int]] = []
        self._order = count()
        self._main = self._running = Runner(getcurrent())
        self._runners: list[Runner] = [self._main]
        self._busy_from = (self.now_s, 0)

    # --- for those that live in it ------------------------------------------------------------------------------------

    def time(self) -> float:
        return self.now_s

    def clock(self) -> float:
        """The product's clock."""
        self.now_s += TICK_S
        return self.now_s

    def call_at(self, at_s: float, callback: Callable[..., object], *args: object) -> Handle:
        handle = Handle(callback, args)
        heappush(self._moments, (at_s, next(self._order), handle, 0))
        return handle

    def call_later(self, delay_s: float, callback: Callable[..., object], *args: object) -> Handle:
        return self.call_at(self.now_s + delay_s, callback, *args)

    def call_soon(self, callback: Callable[..., object], *args: object) -> Handle:
        return self.call_at(self.now_s, callback, *args)

    def me(self) -> Runner:
        """Whose turn it is."""
        return self._running

    def wake(self, runner: Runner, at_s: float | None = None) -> None:
        """End the runner's present wait, now or then."""
        heappush(self._moments, (self.now_s if at_s is None else at_s, next(self._order), runner, runner.turn))

    def wait(self, until_s: float) -> None:
        """Let others run until then (`inf`: until somebody wakes me), or until I am woken."""
        me = self._running
        if until_s < inf:
            self.wake(me, max(until_s, self.now_s))
        following = self._next()
        if following is not me:
            following.let.switch()
        self._running = me
        if self.failure is not None:
            raise StuckError from self.failure

    def start(self, target: Callable[[], object], process: Any = None) -> Runner:
        """A new thread, of the same process as whoever starts it, unless another is named."""
        runner = Runner(greenlet(parent=self._main.let), process or self._running.process)
        runner.let.run = partial(self._live, runner, target)
        self._runners.append(runner)
        self.wake(runner)
        return runner

    def kill(self, process: Any) -> None:
        """All threads of this process vanish in the middle of what they are doing. Not by a thread of its own."""
        for runner in self._runners:
            if runner.process is process and not runner.ended:
                runner.killed = True
                runner.turn += 1

    def close(self) -> None:
        """Let every thread that is left run into its end. By the main runner, at the end of a world."""
        self.failure = self.failure or StuckError("closed")
        while left := [runner for runner in self._runners[1:] if not runner.ended]:
            left[0].let.switch()
        self._moments.clear()

    # --- whose turn it is ---------------------------------------------------------------------------------------------

    def _live(self, runner: Runner, target: Callable[[], object], *_ended: object) -> None:
        self._running = runner
        try:
            if self.failure is None:
                target()
        except BaseException as error:  # noqa: BLE001 - it is shown where the world was started
            self.failure = self.failure or error
        runner.ended = True
        following = self._main if self.failure is not None else self._next()
        runner.let.parent = following.let  # where a greenlet that returns leads to

    def _next(self) -> Runner:
        """Let moments happen until one is a thread's; the main one's where nothing may happen any more."""
        try:
            while self.failure is None:
                at_s, _, what, turn = heappop(self._moments)
                self._pass(at_s)
                if isinstance(what, Handle):
                    if what.callback is not None:
                        what.callback(*what.args)
                elif what.turn == turn and not (what.ended or what.killed):
                    if what.process is not None and what.process.frozen:
                        what.process.waiting.append(what)
                        continue
                    what.turn += 1
                    return what
        except BaseException as error:  # noqa: BLE001 - a callback belongs to nobody: the world ends
            self.failure = self.failure or error
        return self._main

    def _pass(self, at_s: float) -> None:
        self.now_s = max(self.now_s, at_s)
        if self.now_s > self.end_s:
            raise StuckError(f"the world has not ended by {self.end_s:g} s")
        since_s, moments = self._busy_from
        if self.now_s - since_s > 0.001:
            self._busy_from = (self.now_s, 0)
        elif moments > BUSY:
            raise StuckError(f"{BUSY} moments without any time passing, at {self.now_s:.3f} s")
        else:
            self._busy_from = (since_s, moments + 1)
