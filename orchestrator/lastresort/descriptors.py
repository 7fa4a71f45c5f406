"""If fewer files may be open than there are ports, the ports take turns. Standard library only."""

import os
import threading

#: Descriptors reserved for everything but ports: libraries, sockets, the kernel's lists.
RESERVE = 7
#: This many are enough for any station.
PLENTY = 512


def room() -> int:
    """How many ports can be open at once, after raising the limit as far as permitted."""
    limit = os.sysconf("SC_OPEN_MAX")
    if limit < PLENTY:
        limit = raised(limit)
    if not 0 <= limit < PLENTY:
        return PLENTY
    return max(1, limit - sum(map(_is_open, range(limit))) - RESERVE)


def raised(limit: int) -> int:
    """The limit, raised as far as permitted."""
    import resource  # noqa: PLC0415 - needed only in this rare case

    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    except (OSError, ValueError):
        return limit
    return os.sysconf("SC_OPEN_MAX")


def _is_open(fd: int) -> bool:
    try:
        os.fstat(fd)
    except OSError:
        return False
    return True


class Turns:
    """At most `at_once` ports are open; `ports` is how many there are."""

    def __init__(self, at_once: int) -> None:
        self.at_once, self.ports = at_once, 0
        self._free = threading.Semaphore(at_once)
        self.take, self.give = self._free.acquire, self._free.release

    @property
    def crowded(self) -> bool:
        """Whether some ports must wait: then every charger is stopped first, and verified at its port's next turn."""
        return self.ports > self.at_once
