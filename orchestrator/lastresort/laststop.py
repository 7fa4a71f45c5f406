"""Stop chargers on bare file descriptors and verify it: for the guardian and `estop`, when nothing else works any more.

Every line has a thread (`lastline.py`), since whatever is asked of a port's driver may take for ever: so no port ever
waits for another one. This module only starts the threads, looks how they are doing, and leaves behind those that hang.
On ports that are open the first stops are written before, one after the other by one thread, which takes a tenth of the
time; where that gets stuck again and again, each line's own thread does it. Standard library only, few imports.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress

from orchestrator.lastresort.bareport import HELD
from orchestrator.lastresort.descriptors import Turns
from orchestrator.lastresort.lastline import ASK_S, ROUND_S, STOPS, LastLine, Witness
from orchestrator.lastresort.lastport import ANSWER_S

#: The first stops are waited for no longer than this before anything else is done: what else there is would compete
#: with them for the processor.
FIRST_S = 0.05
#: A stop that has not been written by then hangs in the port's driver.
STUCK_S = 0.005
#: So many are gone round; where more hang it is quicker to start a thread for each line.
SWEEPS = 3
#: How often it is looked at what has become of the lines.
LOOK_S = 0.01
#: Ports are closed within this, all together, or are left to the kernel.
CLOSE_S = 0.5


def nobody(_name: str, _since_s: float) -> None:
    """No other process looks after any port."""


class LastStop:
    """Stops the chargers on the ports that it is given, from the first `stop` to `finish`.

    Ports are opened by name, but not if another orchestrator holds them and `leave_held` is set. A charger whose port
    `witness` knows about is not asked here; it may be set later. Never raises for what a port does.
    """

    def __init__(self, *, leave_held: bool = True, watch_s: float = 0.0, turns: Turns | None = None) -> None:
        self.witness: Witness = nobody
        self.hurried = False  #: it is to end as soon as every charger has had its stop
        self._turns = turns
        self._leave_held, self._watch_s = leave_held, watch_s
        self._lines: dict[str, LastLine] = {}
        self._waiting: list[LastLine] = []  # for a thread
        self._began_s = time.monotonic()

    def stop(self, ports: Mapping[str, int | None]) -> None:
        """Have the first stop written on each of these ports; those whose drivers take their time are not waited for.

        `ports` maps names to open descriptors, which are taken over, or to None.
        """
        end_s = time.monotonic() + FIRST_S
        if self._turns is not None:
            self._turns.ports += len(ports)
        lines = [
            LastLine(name, fd, self._seen, leave_held=self._leave_held, turns=self._turns) for name, fd in ports.items()
        ]
        self._lines = {**self._lines, **{line.name: line for line in lines}}
        _sweep(deque(line for line in lines if ports[line.name] is not None))
        self._waiting += lines
        self._start()
        for line in self._waiting:  # no thread to be had: one after the other is better than not at all
            line.first()
        for line in lines:
            line.tried.wait(max(0.0, end_s - time.monotonic()))

    def finish(
        self,
        within_s: float,
        *,
        on_stop: Callable[[], None] = lambda: None,
        on_round: Callable[[], None] = lambda: None,
    ) -> dict[str, str]:
        """Wait until each charger has shown standby for `watch_s`, at the longest until `within_s` after the beginning.

        `on_stop` is called after each round's stops, `on_round` when its chargers have had time to obey and answer.
        Returns for each name "" where standby was verified, else why not.
        """
        end_s, round_s = self._began_s + within_s * self._shifts, self._began_s
        while True:
            _pause_until(round_s + STOPS[-1][0])
            on_stop()
            _pause_until(round_s + ASK_S)
            self._pause_until(round_s + ASK_S + ANSWER_S)
            on_round()
            self._start()
            round_s += ROUND_S
            self._pause_until(min(round_s, end_s))
            if self._settled() or round_s >= end_s:
                return self._end()

    @property
    def _shifts(self) -> int:
        """How many times as long it takes where ports take turns."""
        return 1 if self._turns is None else -(-self._turns.ports // self._turns.at_once)

    def _seen(self, name: str, since_s: float) -> tuple[float, str] | None:
        return self.witness(name, since_s)

    def _start(self) -> None:
        self._waiting = [line for line in self._waiting if not line.start()]

    def _pause_until(self, at_s: float) -> None:
        """At most until then: less, if there is nothing left to do."""
        while time.monotonic() < at_s and not self._settled():
            time.sleep(LOOK_S)

    def _settled(self) -> bool:
        if self.hurried and all(line.tried.is_set() for line in self._lines.values()):
            return True
        since_s = time.monotonic() - self._watch_s
        return all(
            line.why == HELD or (not line.why and line.shown_s is not None and line.shown_s <= since_s)
            for line in self._lines.values()
        )

    def _end(self) -> dict[str, str]:
        lines = self._lines  # it may be replaced by one that has more
        for line in lines.values():
            line.end()
        close_s = time.monotonic() + CLOSE_S
        for line in lines.values():
            line.join(max(0.0, close_s - time.monotonic()))
        return {name: line.why for name, line in lines.items()}


def stop_all(
    ports: Mapping[str, int | None],
    within_s: float,
    *,
    leave_held: bool = True,
    watch_s: float = 0.0,
    on_stop: Callable[[], None] = lambda: None,
    on_round: Callable[[], None] = lambda: None,
) -> dict[str, str]:
    """Stop the charger on every port; all of `LastStop` at once."""
    stopping = LastStop(leave_held=leave_held, watch_s=watch_s)
    stopping.stop(ports)
    return stopping.finish(within_s, on_stop=on_stop, on_round=on_round)


def _sweep(lines: deque[LastLine]) -> None:
    """Write the first stop on each of these lines; past one that gets stuck another thread goes on."""

    def write() -> None:
        with suppress(IndexError):
            while True:
                lines.popleft().first()

    for _ in range(SWEEPS):
        sweeper = threading.Thread(target=write, daemon=True)
        with suppress(RuntimeError):  # no thread to be had
            sweeper.start()
            left = -1
            while sweeper.is_alive() and len(lines) != left:
                left = len(lines)
                sweeper.join(STUCK_S)
    lines.clear()


def _pause_until(at_s: float) -> None:
    left_s = at_s - time.monotonic()
    if left_s > 0:
        time.sleep(left_s)
