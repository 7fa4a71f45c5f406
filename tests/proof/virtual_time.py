"""Jumping time for the unchanged service: its threads run one at a time, and the clock moves when all of them wait.

A virtual thread is a greenlet. A waiting thread takes the next item from one queue of moments: it runs callbacks on the
spot and switches to threads. So everything happens in one order, the same in every run, and an hour passes as fast as
it can be computed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import Any

from greenlet import getcurrent, greenlet

#: A clock never shows the same time twice; this is also the cost of reading it.
TICK_S = 1e-6
#: More moments than this within so short a time: a thread spins without waiting.
BUSY = 20_000
MOMENT_S = 0.001


class StuckError(BaseException):
    """The world was ended from outside, or only can be; no boundary of the product may swallow this."""


@dataclass(slots=True)
class Handle:
    """A pending callback."""

    callback: Callable[..., object] | None
    args: tuple[object, ...]

    def cancel(self) -> None:
        self.callback = None


@dataclass(slots=True, eq=False)
class Runner:
    """One virtual thread; `turn` counts its wake-ups, so that a later one for the same wait is void."""

    let: greenlet
    process: Any = None  #: the thread's `virtual_process.Process`, or None
    turn: int = 0
    ended: bool = False
    killed: bool = False  #: it never runs again, not even its clean-up, until the world is closed


class Time:
    """The clock, the queue of moments, whose turn it is. `call_later`, `call_soon`, `time` as in an asyncio loop."""

    def __init__(self, end_s: float = inf) -> None:
        self.now_s = 1000.0
        self.end_s = self.now_s + end_s
        self.failure: BaseException | None = None  #: the error that ended the world, if any
        self._moments: list[tuple[float, int, Handle | Runner, int]] = []
        self._order = count()
        self._main = self._running = Runner(getcurrent())
        self._runners: list[Runner] = [self._main]
        self._busy = 0  #: moments so far until …
        self._idle_s = self.now_s

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
        """Whose turn it is: the caller."""
        if getcurrent() is not self._running.let:
            raise OSError("a thread of the real machine, left over from another test: it has no turn here")
        return self._running

    def wake(self, runner: Runner, at_s: float | None = None) -> None:
        """End the runner's current wait, now or at the given time."""
        heappush(self._moments, (self.now_s if at_s is None else at_s, next(self._order), runner, runner.turn))

    def wait(self, until_s: float) -> None:
        """Let others run until then (`inf`: without a limit), or until woken."""
        me = self.me()
        if until_s < inf:
            self.wake(me, max(until_s, self.now_s))
        following = self._next()
        if following is not me:
            following.let.switch()
        self._running = me
        if self.failure is not None:
            raise StuckError from self.failure

    def start(self, target: Callable[[], object], process: Any = None) -> Runner:
        """A new thread, in its starter's process unless another is given."""
        runner = Runner(greenlet(parent=self._main.let), process or self.me().process)
        runner.let.run = partial(self._live, runner, target)
        self._runners.append(runner)
        self.wake(runner)
        return runner

    def kill(self, process: Any) -> None:
        """All threads of this process vanish in the middle of their work. Not for its own threads to call."""
        for runner in self._runners:
            if runner.process is process and not runner.ended:
                runner.killed = True
                runner.turn += 1

    def close(self) -> None:
        """End every remaining thread. Called by the main runner at the end of a world."""
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
        except BaseException as error:  # noqa: BLE001 - it is raised where the world was started
            self.failure = self.failure or error
        runner.ended = True
        following = self._main if self.failure is not None else self._next()
        runner.let.parent = following.let  # where a finished greenlet continues

    def _next(self) -> Runner:
        """Run moments until one belongs to a thread; to the main one if nothing can happen any more."""
        moments = self._moments
        try:
            while self.failure is None:
                at_s, _, what, turn = heappop(moments)
                if at_s > self.now_s:
                    self.now_s = at_s
                if self.now_s > self._idle_s:
                    self._idle_s, self._busy = self.now_s + MOMENT_S, 0
                self._busy += 1
                if self._busy > BUSY or self.now_s > self.end_s:
                    raise StuckError(self._why_stuck())
                if isinstance(what, Handle):
                    if what.callback is not None:
                        what.callback(*what.args)
                elif what.turn == turn and not (what.ended or what.killed):
                    if what.process is not None and what.process.frozen:
                        what.process.waiting.append(what)
                        continue
                    what.turn += 1
                    return what
        except BaseException as error:  # noqa: BLE001 - a callback has no thread: the world ends
            self.failure = self.failure or error
        return self._main

    def _why_stuck(self) -> str:
        if self.now_s > self.end_s:
            return f"the world has not ended by {self.end_s:g} s"
        return f"{BUSY} moments without any time passing, at {self.now_s:.3f} s"
