"""Stops chargers on bare file descriptors and verifies the stops: for the guardian and `estop`, as a last resort.

Every line has its own thread (`lastline.py`), because any driver call may block for ever: so no port waits for another.
This module only starts the threads, monitors them, and abandons those that hang. On open ports, a single thread writes
the first stops beforehand, one after another, which takes a tenth of the time; if that keeps getting stuck, each line's
own thread does it. Standard library only, few imports.
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

#: The longest wait for the first stops before doing anything else, which would compete with them for the CPU.
FIRST_S = 0.05
#: A stop not written within this hangs in the port's driver.
STUCK_S = 0.005
#: This many stuck ports are bypassed; if more hang, starting a thread for each line is faster.
SWEEPS = 3
#: How often the lines are checked.
LOOK_S = 0.01
#: All ports together are closed within this, or left to the kernel.
CLOSE_S = 0.5


def nobody(_name: str, _since_s: float) -> None:
    """The witness if no other process is in charge of any port."""


class LastStop:
    """Stops the chargers on the given ports, from the first `stop` to `finish`.

    Ports are opened by name, unless another orchestrator holds them and `leave_held` is set. If `witness`, which may be
    set later, knows about a port, its charger is not queried here. A failing port never raises.
    """

    def __init__(self, *, leave_held: bool = True, watch_s: float = 0.0, turns: Turns | None = None) -> None:
        self.witness: Witness = nobody
        self.hurried = False  #: end as soon as every charger has been sent its stop
        self._turns = turns
        self._leave_held, self._watch_s = leave_held, watch_s
        self._lines: dict[str, LastLine] = {}
        self._waiting: list[LastLine] = []  # lines that have no thread yet
        self._began_s = time.monotonic()

    def stop(self, ports: Mapping[str, int | None]) -> None:
        """Write the first stop on each of these ports, without waiting for slow drivers.

        `ports` maps names to open descriptors, of which this takes ownership, or to None.
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
        for line in self._waiting:  # no threads available: one after another is better than not at all
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
        """Wait until each charger has shown standby for `watch_s`, but at most `within_s` from the beginning.

        `on_stop` is called after each round's stops, `on_round` once the chargers have had time to obey and answer.
        Returns, by name, "" if standby was verified, else why not.
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
        """The factor by which taking turns prolongs everything."""
        return 1 if self._turns is None else -(-self._turns.ports // self._turns.at_once)

    def _seen(self, name: str, since_s: float) -> tuple[float, str] | None:
        return self.witness(name, since_s)

    def _start(self) -> None:
        self._waiting = [line for line in self._waiting if not line.start()]

    def _pause_until(self, at_s: float) -> None:
        """Wait until then, or until there is nothing left to do."""
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
        lines = self._lines  # another thread may replace it by a larger one
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
    """Stop the charger on every port: all of `LastStop` in one call."""
    stopping = LastStop(leave_held=leave_held, watch_s=watch_s)
    stopping.stop(ports)
    return stopping.finish(within_s, on_stop=on_stop, on_round=on_round)


def _sweep(lines: deque[LastLine]) -> None:
    """Write the first stop on each of these lines; if one gets stuck, another thread continues past it."""

    def write() -> None:
        with suppress(IndexError):
            while True:
                lines.popleft().first()

    for _ in range(SWEEPS):
        sweeper = threading.Thread(target=write, daemon=True)
        with suppress(RuntimeError):  # no thread available
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
