"""The terms of one start: to which SOC, and when."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Self

from orchestrator.errors import RequestError
from orchestrator.model import Cause, Request
from orchestrator.record.lasting import lasting
from orchestrator.service.instant import instant
from orchestrator.service.reception import Answer, Later
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import fields

#: A start with a target or a time: a verb of its own, because a service that knows neither must not start at once.
START_WITH = "start-with"
#: What a start may say beside its verb, and what one with terms may say besides.
KNOWN = frozenset({"verb", "bays", "port", "spares", "because", "by", "sudo_user", "uid"})
TERMS = frozenset({"to", "at"})


@dataclass(frozen=True, slots=True)
class Terms:
    """What a request says of them, checked; None: to the policy's target, and at once."""

    target_pct: float | None = None
    start_unix_s: float | None = None
    doubt: Cause | None = None  #: which instant is meant, where daylight saving leaves a doubt

    @classmethod
    def of(cls, request: Mapping[str, object], now_s: float) -> Self:
        """Of any request; RequestError for what cannot be done, and for a start that says more than is understood."""
        verb = request.get("verb")
        unknown = request.keys() - KNOWN - (TERMS if verb == START_WITH else set())
        if unknown and verb in (Request.START, START_WITH):
            raise RequestError(Cause.of("start_keys_unknown", keys=tuple(f"{key:.40}" for key in sorted(unknown)[:5])))
        if verb != START_WITH:
            return cls()
        target, at = request.get("to"), request.get("at")
        if target is not None and not is_target(target):
            raise RequestError(Cause.of("target_wrong", target=f"{target!s:.40}"))
        start_unix_s, doubt = (None, None) if at is None else instant(at, now_s)
        return cls(float(target) if isinstance(target, int | float) else None, start_unix_s, doubt)

    @property
    def fields(self) -> dict[str, object]:
        """For the journal's record of the request; `start_at` is Unix time."""
        found = {"target_soc_pct": self.target_pct, "start_at": self.start_unix_s}
        return {name: value for name, value in found.items() if value is not None}

    def told(self, results: Later, wall: Callable[[], float], language: str) -> Later:
        """These results; with them, of a start for later, when that is."""
        at_s = self.start_unix_s
        if at_s is None:
            return results

        def answer() -> Answer | None:
            found, now_s = results(), wall()
            then = Cause.of("starts_in", start_unix_s=at_s, lasts=lasting(at_s - now_s), doubt=self.doubt)
            return found if found is None else {**found, "then": fields(WallClock(now_s, now_s).told(then), language)}

        return answer


def is_target(value: object) -> bool:
    """Whether it is a SOC that a charge can go to."""
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value) and 0 < value <= 100
