"""Opens contactors as a last resort: each in its own thread, since its driver may hang.

Standard library only, few imports.
"""

import threading
import time
from collections.abc import Callable
from functools import partial

#: Reported for a contactor whose driver has not answered.
HANGS = "its driver hangs"
#: How often the results are checked.
LOOK_S = 0.01


class Contactors:
    """`became` has each contactor's result, keyed by the caller's name for it."""

    def __init__(self) -> None:
        self.became: dict[object, str] = {}
        self._opening: set[object] = set()

    def open(self, name: object, open_one: Callable[[], str]) -> None:
        """Begin to open it, unless that is already under way; `open_one` returns the result."""
        if name not in self._opening:
            self._opening.add(name)
            self.became.setdefault(name, HANGS)
            aside(partial(self._open, name, open_one))

    def _open(self, name: object, open_one: Callable[[], str]) -> None:
        self.became[name] = open_one()
        self._opening.discard(name)

    def wait(self, within_s: float) -> None:
        """Wait until each driver has answered once, or the time is up."""
        end_s = time.monotonic() + within_s
        while HANGS in self.became.values() and time.monotonic() < end_s:
            time.sleep(LOOK_S)


def aside(work: Callable[[], object]) -> None:
    """Do it in a thread: a slow driver must not interrupt the watch. If no thread can be started, do it here."""
    try:
        threading.Thread(target=work, daemon=True).start()
    except RuntimeError:
        work()
