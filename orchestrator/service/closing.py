"""Closes everything that may hang: each in its own thread, all within one time limit."""

import threading
from collections.abc import Callable, Iterable
from time import monotonic


def close_all(closings: Iterable[Callable[[], object]], within_s: float) -> bool:
    """Begin all of them at once; returns whether all ended in time. Those that hang are abandoned.

    Where no thread can be started, each is done here: the guardian ends a process that hangs at its end.
    """
    end_s = monotonic() + within_s
    threads = []
    for close in closings:
        thread = threading.Thread(target=close, name="closing", daemon=True)
        try:
            thread.start()
        except RuntimeError:
            close()
        else:
            threads.append(thread)
    for thread in threads:
        thread.join(max(end_s - monotonic(), 0.0))
    return not any(thread.is_alive() for thread in threads)
