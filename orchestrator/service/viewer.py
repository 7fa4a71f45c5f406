"""Answers on the view socket: it tells, and does nothing.

It has a log of its own, so that what viewers try takes no room from the records of what operators ask.
"""

from collections.abc import Callable, Mapping

from orchestrator.errors import RequestError
from orchestrator.model import Cause
from orchestrator.service.asker import Asker
from orchestrator.service.reception import STATUS, WATCH, Answer, Handler, Later
from orchestrator.service.request_log import RequestLog

#: What viewers may ask.
QUESTIONS = (STATUS, WATCH)


class Viewer:
    """Lets `handler` answer questions, and refuses everything else. Used by the view socket's thread only."""

    def __init__(self, handler: Handler, log: RequestLog, wall: Callable[[], float]) -> None:
        self._handler, self._log, self._wall = handler, log, wall

    def answer(self, request: Mapping[str, object]) -> Answer | Later:
        """Whatever was asked; RequestError where it is more than a question."""
        verb = request.get("verb")
        if verb != STATUS:
            raise RequestError(Cause.of("view_only", verb=f"{verb!s:.80}", verbs=QUESTIONS))
        return self._handler(request)

    def refused(self, request: Mapping[str, object], why: Cause) -> None:
        """Write down what a viewer was not allowed to do."""
        verb = request.get("verb")
        if verb not in QUESTIONS:
            self._log.write("", f"{verb!s:.80}", Asker.of(request, self._wall()), why)
