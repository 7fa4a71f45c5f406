"""Wait for something that another thread or process is about to do, with a deadline."""

import time
from collections.abc import Callable
from threading import Event


def wait_until(
    condition: Callable[[], object], timeout_s: float = 5.0, what: str = "the condition", every_s: float = 0.005
) -> None:
    """Return once `condition()`, checked every `every_s`, is true; fail the test if it is not within `timeout_s`."""
    deadline_s = time.monotonic() + timeout_s
    pause = Event()
    while not condition():
        assert time.monotonic() < deadline_s, f"{what} did not come true within {timeout_s:g} s"
        pause.wait(every_s)
