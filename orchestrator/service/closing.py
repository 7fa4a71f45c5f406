"""Closes everything that may hang: each in its own thread, all within one time limit."""

import threading
from collections.abc import Callable, Iterable
from time import monotonic


def close_all(closings: Iterable[Callable[[], object]], within_s: float) -> bool:
    """Begin all of them at once; returns whether all ended in time. Those that hang are abandoned."""
    end_s = monotonic() + within_s
    threads = [threading.Thread(target=close, name="closing", daemon=True) for close in closings]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(max(end_s - monotonic(), 0.0))
    return not any(thread.is_alive() for thread in threads)
