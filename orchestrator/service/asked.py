"""A request of an operator on its way: decided by one step, answered when its effect is on the disk."""

from threading import Event

from orchestrator.model import Cause, Request
from orchestrator.service.store import KEPT_WITHIN_S, Store


class Asked:
    """`answer` is set when `done` is: None is yes."""

    def __init__(self, request: Request) -> None:
        self.request = request
        self.answer: Cause | None = None
        self.done = Event()


class Answers:
    """The requests of one bay that were done, and are not on the disk yet. Used by the control loop only."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self.waiting: list[tuple[Asked, int, float]] = []  #: with the revision that keeps it, and until when to wait

    def give(self, asked: Asked, answer: Cause | None, revision: int, now_s: float) -> None:
        """Answer it: a refusal at once, what was done when the disk has it."""
        asked.answer = answer
        if answer is not None:
            asked.done.set()
        else:
            self.waiting.append((asked, revision, now_s + KEPT_WITHIN_S))

    def look(self, now_s: float) -> None:
        """Tell those whose time has come."""
        kept = self._store.kept_revision
        left = []
        for asked, revision, until_s in self.waiting:
            if revision > kept and now_s < until_s:
                left.append((asked, revision, until_s))
                continue
            if revision > kept:
                problem = self._store.unkept(now_s)
                asked.answer = Cause.of("not_kept", problem=problem) if problem else Cause("not_taken")
            asked.done.set()
        self.waiting = left
