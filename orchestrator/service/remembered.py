"""What is to be remembered of one place, until the disk has it."""

from dataclasses import dataclass
from typing import Self

from orchestrator.core.persisted import Persisted


@dataclass(frozen=True, slots=True)
class Remembered:
    """A bay's persisted state, and since when it has been so; `run` is the run of the service that last had the bay."""

    persisted: Persisted
    at_s: float
    run: int
    gist: object  #: what may be relied on
    counters: object  #: they change while current flows

    @classmethod
    def of(cls, persisted: Persisted, now_s: float, run: int) -> Self:
        """As it is now."""
        session, soc = persisted.session, persisted.soc
        counters = (session and (session.elapsed_s, session.charged_ah), soc and soc[1])
        return cls(persisted, now_s, run, persisted.gist, counters)
