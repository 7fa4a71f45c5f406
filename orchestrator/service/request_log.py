"""The journal's record of every request: who, what, which bay, why, and the answer."""

from collections.abc import Callable

from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.service.asker import Asker, user_name
from orchestrator.service.journal import Journal
from orchestrator.text.catalogue import say

#: A program that asks without end must not displace what else the journal holds: this many records at once, and …
BURST = 1000
#: … then so many a second; the next record counts those left out.
RATE = 2.0


class RequestLog:
    """Writes the records. Used by the control thread only."""

    def __init__(self, journal: Journal, clock: Callable[[], float], language: str) -> None:
        self._journal, self._clock, self._language = journal, clock, language
        self._room, self._room_s, self._left_out = float(BURST), clock(), 0

    def write(self, bay: str, verb: str, asker: Asker, answer: Cause | None, **more: object) -> None:
        """One request and its answer, None meaning yes; `bay` is "" if it reached none."""
        if not self._has_room():
            self._left_out += 1
            return
        by = {"uid": asker.uid, "user": user_name(asker.uid)} if asker.uid is not None else {}
        fields: dict[str, object] = {
            "request": verb,
            "by": say(who, self._language) if isinstance(who := asker.who, Cause) else who,
            **by,
            "sudo_user": asker.behind,
            "because": asker.because,
            "passed_on": asker.by,
            "means": "estop" if asker.estop else "",
            "accepted": answer is None,
            "answer": say(answer, self._language),
            "cause": plain(answer) if answer is not None else None,
            **more,
        }
        if self._left_out:
            fields["left_out"], self._left_out = self._left_out, 0
        self._journal.put(bay, ("request", fields))

    def _has_room(self) -> bool:
        now_s = self._clock()
        self._room = min(self._room + (now_s - self._room_s) * RATE, BURST)
        self._room_s = now_s
        if self._room < 1.0:
            return False
        self._room -= 1.0
        return True
