"""The state of one place in memory, until it is on disk."""

from dataclasses import dataclass
from typing import Self

from orchestrator.core.persisted import Persisted


@dataclass(frozen=True, slots=True)
class Remembered:
    """A bay's persisted state, and since when it holds; `run` is the run of the service that last had the bay."""

    persisted: Persisted
    at_s: float
    run: int
    gist: object  #: the part that may be relied on once it is on disk
    counters: object  #: the part that changes while current flows

    @classmethod
    def of(cls, persisted: Persisted, now_s: float, run: int) -> Self:
        """The present state."""
        session, soc = persisted.session, persisted.soc
        counters = (session and (session.elapsed_s, session.charged_ah), soc and soc[1])
        return cls(persisted, now_s, run, persisted.gist, counters)
