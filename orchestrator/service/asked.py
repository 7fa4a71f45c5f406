"""A request of an operator on its way: decided by one step, answered when its effect is on the disk."""

from collections.abc import Callable
from itertools import takewhile
from threading import Event, Lock

from orchestrator.model import Cause, Request
from orchestrator.service.store import KEPT_WITHIN_S, Store


class Asked:
    """`answer` is set when `done` is: None is yes."""

    def __init__(self, request: Request) -> None:
        self.request = request
        self.answer: Cause | None = None
        self.done = Event()


class Requests:
    """What was asked of one bay and is not decided yet. From any thread."""

    def __init__(self) -> None:
        self._asked: list[Asked] = []
        self._lock = Lock()

    def __bool__(self) -> bool:
        return bool(self._asked)

    def put(self, asked: Asked) -> None:
        """A stop waits for nothing: what was asked before it and is not done yet is refused."""
        with self._lock:
            if asked.request is Request.STOP:
                for early in (one for one in self._asked if one.request is not Request.STOP):
                    early.answer = Cause("overtaken")
                    early.done.set()
                self._asked = [one for one in self._asked if one.request is Request.STOP]
            self._asked.append(asked)

    def take(self) -> list[Asked]:
        """The request whose turn it is, as often as it was made in a row: one step answers all of them."""
        with self._lock:
            taken = list(takewhile(lambda one: one.request is self._asked[0].request, self._asked))
            del self._asked[: len(taken)]
            return taken


class Answers:
    """The requests of one bay that were done, and are not on the disk yet. Used by the control loop only.

    A start that no disk takes is withdrawn: `withdraw` holds the bay again. Nothing has begun: a charger is told
    to run only once the disk has the beginning.
    """

    def __init__(self, store: Store, withdraw: Callable[[], None]) -> None:
        self._store, self._withdraw = store, withdraw
        self.waiting: list[
            tuple[Asked, int, float, bool]
        ] = []  #: with the revision that keeps it, until when to wait, and whether it changed something

    def give(self, asked: Asked, answer: Cause | None, revision: int, now_s: float, *, changed: bool = True) -> None:
        """Answer it: a refusal at once, what was done when the disk has it."""
        asked.answer = answer
        if answer is not None:
            asked.done.set()
        else:
            self.waiting.append((asked, revision, now_s + KEPT_WITHIN_S, changed))

    def look(self, now_s: float) -> None:
        """Tell those whose time has come."""
        kept = self._store.kept_revision
        left = []
        for asked, revision, until_s, changed in self.waiting:
            if revision > kept and now_s < until_s:
                left.append((asked, revision, until_s, changed))
                continue
            if revision > kept:
                starts, problem = asked.request is Request.START, self._store.unkept(now_s)
                asked.answer = Cause.of("not_done" if starts else "not_kept", problem=problem or Cause("not_taken"))
                if starts and changed:
                    self._withdraw()
            asked.done.set()
        self.waiting = left
