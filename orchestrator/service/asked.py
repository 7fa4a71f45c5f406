"""An operator's request on its way: handled by one decision, answered when its effect is on disk."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import takewhile
from threading import Event, Lock

from orchestrator.core.memory import Memory
from orchestrator.core.persisted import TimedStart
from orchestrator.model import Cause, Request
from orchestrator.service.asker import NOBODY, Asker, held_by_others, started_later
from orchestrator.service.store import KEPT_WITHIN_S, Store


class Asked:
    """`answer` is valid once `done` is set: None means yes. `spares`: a bay that somebody else holds is left alone.

    A start may have a target for its one charge, `target_pct`, and a time, `start_unix_s`: then it is only noted, and
    made at that time, as `timed`.
    """

    def __init__(
        self,
        request: Request,
        asker: Asker = NOBODY,
        spares: bool = False,  # noqa: FBT001, FBT002 - as in a request
        target_pct: float | None = None,
        start_unix_s: float | None = None,
        timed: TimedStart | None = None,
    ) -> None:
        self.request, self.asker, self.spares = request, asker, spares
        self.target_pct, self.start_unix_s, self.timed = target_pct, start_unix_s, timed
        self.answer: Cause | None = None
        self.done = Event()

    @classmethod
    def of(cls, timed: TimedStart) -> "Asked":
        """A start whose time has come."""
        return cls(Request.START, target_pct=timed.target_pct, timed=timed)

    @property
    def by(self) -> Cause | None:
        """Who asks, and why, as the core takes it."""
        if self.timed is not None:
            return started_later(self.timed)
        return self.asker.cause(self.request, self.target_pct)

    def is_like(self, other: "Asked") -> bool:
        """Whether one decision answers both."""
        return self.sort == other.sort

    def spared(self, memory: Memory | None, bay: str) -> Cause | None:
        """Why the bay is left alone, if it is."""
        what = held_by_others(memory.operator, self.asker.person) if self.spares and memory is not None else None
        return Cause.of("held_by_others", what=what, bay=bay) if what is not None else None

    @property
    def sort(self) -> tuple[object, ...]:
        """Equal for requests that are alike."""
        return self.request, self.asker, self.spares, self.target_pct, self.start_unix_s, self.timed


@dataclass(frozen=True, slots=True)
class Taken:
    """What is asked of one decision."""

    request: Request | None = None
    by: Cause | None = None  #: who asks, and why
    target_pct: float | None = None
    noted: TimedStart | None = None  #: a start that is asked for later …
    timed: TimedStart | None = None  #: … or one whose time has come
    refusal: Cause | None = None  #: why nothing is asked of it

    @classmethod
    def of(cls, asked: Sequence[Asked], memory: Memory | None, bay: str) -> "Taken":
        """Of the requests that one decision answers: they are all alike."""
        if not asked:
            return cls()
        one = asked[0]
        if (spared := one.spared(memory, bay)) is not None:
            return cls(timed=one.timed, refusal=spared)
        if one.start_unix_s is not None:
            later = TimedStart(one.start_unix_s, one.asker.cause(one.request), one.target_pct)
            return cls(noted=later)
        return cls(one.request, one.by, one.target_pct, timed=one.timed)


class Requests:
    """The requests to one bay that are not decided yet. Thread-safe."""

    def __init__(self) -> None:
        self._asked: list[Asked] = []
        self._lock = Lock()

    def __bool__(self) -> bool:
        return bool(self._asked)

    def put(self, asked: Asked) -> None:
        """Add a request. A stop waits for nothing: earlier requests that are not done yet are refused."""
        with self._lock:
            if asked.request is Request.STOP:
                for early in (one for one in self._asked if one.request is not Request.STOP):
                    early.answer = Cause("overtaken")
                    early.done.set()
                self._asked = [one for one in self._asked if one.request is Request.STOP]
            self._asked.append(asked)

    def take(self) -> list[Asked]:
        """The next request, with its consecutive repetitions: one decision answers all of them."""
        with self._lock:
            taken = list(takewhile(lambda one: one.is_like(self._asked[0]), self._asked))
            del self._asked[: len(taken)]
            return taken


class Answers:
    """One bay's completed requests that are not on disk yet. Used by the control loop only.

    A start that the disk does not take is withdrawn: `withdraw` holds the bay again. Nothing has begun by then: a
    charger is commanded to run only once the start is on disk. One that is asked for later is forgotten (`forget`).
    """

    def __init__(self, store: Store, withdraw: Callable[[], None], forget: Callable[[Asked], None]) -> None:
        self._store, self._withdraw, self._forget = store, withdraw, forget
        self.waiting: list[
            tuple[Asked, int, float, bool]
        ] = []  #: (request, revision that persists it, time until which to wait, whether it changed anything)

    def give(self, asked: Asked, answer: Cause | None, revision: int, now_s: float, *, changed: bool = True) -> None:
        """Answer a request: a refusal at once, an accepted one when it is on disk."""
        asked.answer = answer
        if answer is not None:
            asked.done.set()
        else:
            self.waiting.append((asked, revision, now_s + KEPT_WITHIN_S, changed))

    def look(self, now_s: float) -> None:
        """Answer the requests that are on disk or have waited long enough."""
        kept = self._store.persisted_revision
        left = []
        for asked, revision, until_s, changed in self.waiting:
            if revision > kept and now_s < until_s:
                left.append((asked, revision, until_s, changed))
                continue
            if revision > kept:
                starts, problem = asked.request is Request.START, self._store.not_persisted(now_s)
                asked.answer = Cause.of(
                    "not_done" if starts else "done_not_persisted", problem=problem or Cause("not_taken")
                )
                if asked.start_unix_s is not None:
                    self._forget(asked)
                elif starts and changed:
                    self._withdraw()
            asked.done.set()
        self.waiting = left
