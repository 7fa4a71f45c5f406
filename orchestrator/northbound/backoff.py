"""Failed logins: the next attempt of the same name, or from the same address, has to wait. Pure; time is given.

A name waits less than an address: somebody elsewhere must not be able to keep its owner out.
"""

from dataclasses import dataclass, field


@dataclass(slots=True)
class Failures:
    """Of one name or address."""

    count: int = 0
    until_s: float = 0.0  #: no attempt before this
    last_s: float = 0.0


@dataclass(slots=True)
class Backoff:
    """Of all names, or of all addresses."""

    free: int  #: so many failures cost nothing
    longest_s: float
    most: int = 1000  #: no more are remembered; the oldest are forgotten first
    forgets_s: float = 900.0  #: a failure this old counts no more
    _failures: dict[str, Failures] = field(default_factory=dict)

    def wait_s(self, who: str, now_s: float) -> float:
        """How long until the next attempt; 0: now."""
        found = self._failures.get(who)
        return max(found.until_s - now_s, 0.0) if found else 0.0

    def failed(self, who: str, now_s: float) -> None:
        """Count an attempt; each one past the free ones doubles the wait."""
        found = self._failures.pop(who, Failures())
        if now_s - found.last_s > self.forgets_s:
            found = Failures()
        found.count, found.last_s = found.count + 1, now_s
        if found.count > self.free:
            found.until_s = now_s + min(2.0 ** min(found.count - self.free, 30), self.longest_s)
        self._failures[who] = found
        while len(self._failures) > self.most:
            del self._failures[next(iter(self._failures))]

    def succeeded(self, who: str) -> None:
        """Forget the failures."""
        self._failures.pop(who, None)
