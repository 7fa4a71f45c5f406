"""Contactors that are opened when nothing else is left: each in a thread of its own, since its driver may hang.

Standard library only, few imports.
"""

import threading
import time
from collections.abc import Callable
from functools import partial

#: What is said of one whose driver has not answered.
HANGS = "its driver hangs"
#: How often it is looked at what has become of them.
LOOK_S = 0.01


class Contactors:
    """`became` says what became of each contactor, by whatever its owner knows it by."""

    def __init__(self) -> None:
        self.became: dict[object, str] = {}
        self._opening: set[object] = set()

    def open(self, name: object, open_one: Callable[[], str]) -> None:
        """Begin to open it, unless that is under way; `open_one` says what became of it."""
        if name not in self._opening:
            self._opening.add(name)
            self.became.setdefault(name, HANGS)
            aside(partial(self._open, name, open_one))

    def _open(self, name: object, open_one: Callable[[], str]) -> None:
        self.became[name] = open_one()
        self._opening.discard(name)

    def wait(self, within_s: float) -> None:
        """Until each driver has answered once, or that is over."""
        end_s = time.monotonic() + within_s
        while HANGS in self.became.values() and time.monotonic() < end_s:
            time.sleep(LOOK_S)


def aside(work: Callable[[], object]) -> None:
    """Do it in a thread: what a driver takes its time over must keep nobody from watching. Without one, do it here."""
    try:
        threading.Thread(target=work, daemon=True).start()
    except RuntimeError:
        work()
