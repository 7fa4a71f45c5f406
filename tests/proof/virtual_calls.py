"""The calls of the virtual kernel: any of them can be made to fail as in a real kernel, or to take time."""

import os
import termios
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any

from tests.proof.virtual_time import Time


@dataclass(slots=True)
class Trouble:
    """Calls of this name, at this place (part of a path; "" anywhere), take this long or fail with this errno."""

    call: str
    place: str
    until_s: float = inf
    delay_s: float = 0.0
    error: int = 0
    times: float = inf
    exact: bool = False  #: only this path, not anything below it

    def meets(self, call: str, place: str, now_s: float) -> bool:
        there = self.place == place if self.exact else self.place in place
        return call == self.call and there and now_s < self.until_s and self.times > 0


class Calls:
    """Every call passes here; `on_call` may raise, or return a replacement result."""

    def __init__(self, time: Time) -> None:
        self._time = time
        self.on_call: Callable[[str], Any] | None = None  #: its name → None: continue
        self.troubles: list[Trouble] = []

    def __call__(self, name: str, place: str = "") -> Any:
        if self.troubles:
            self._trouble(name, place)
        return None if self.on_call is None else self.on_call(name)

    def _trouble(self, name: str, place: str) -> None:
        for trouble in self.troubles:
            if trouble.meets(name, place, self._time.now_s):
                trouble.times -= 1
                if trouble.delay_s:
                    self._hang(trouble.delay_s)
                if trouble.error:
                    error = termios.error if name in ("tcgetattr", "tcsetattr", "tcflush") else OSError
                    raise error(trouble.error, os.strerror(trouble.error), place)
                return

    def _hang(self, delay_s: float) -> None:
        """In the kernel: nothing wakes this thread earlier, and its process cannot die until then."""
        process, until_s = self._time.me().process, self._time.now_s + delay_s
        if process is not None:
            process.in_kernel(until_s)
        while self._time.now_s < until_s:
            self._time.wait(until_s)
