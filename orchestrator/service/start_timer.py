"""The start of one bay at a time of day: noted, kept over restarts, and made when the wall clock says so.

Theory of operation. The wall clock alone decides: where it is set back the start waits longer, where it is set forward
it comes earlier. A start that is due is made by the next decision, as if its person had typed it then, and again for a
minute while it is refused: right after a restart no BMU has been heard yet. What refuses it then is kept, for the
status. It is not made where something has happened since that a person must look at first: who asked did not know of
it. After `MOST_LATE_S` nobody counts on it any more, whether the service was down or the clock
was set: it is missed, and not made. A stop, a pause, or another start, cancels it. Whatever comes of it goes into the
journal; that it was not made, or that a stop or a pause has cancelled it, is in the status for a day.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from orchestrator.core.persisted import Persisted, TimedStart
from orchestrator.model import Alarm, Cause, Decision, Request, State
from orchestrator.model.bay_document import Waiting
from orchestrator.model.cause import plain, without_then
from orchestrator.model.document import TimedStart as TimedStartFields
from orchestrator.model.told import ToldCause
from orchestrator.service.asked import Asked, Taken
from orchestrator.service.asker import started_later
from orchestrator.service.journal import Journal
from orchestrator.service.past import Place
from orchestrator.service.store import Store
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import as_told, say

#: A start that could not be made is still made within this.
MOST_LATE_S = 3600.0
#: For how long a start that is refused is tried again, and how often.
PATIENCE_S, AGAIN_S = 60.0, 5.0
#: Why a bay is paused by a person: only a start ends that.
PAUSES = frozenset({"operator_pause", "paused_by"})
#: For how long the status tells why one was not made.
TOLD_S = 86400.0
#: The outcome of one that somebody has cancelled …
CANCELLED = "start_cancelled"
#: … and by what, if nobody knows who that was.
NAMELESS = {Request.STOP: "operator_stop", Request.PAUSE: "operator_pause", Request.START: "operator_start"}


class StartTimer:
    """Used by the control loop, except `status`."""

    def __init__(
        self, place: Place, store: Store, journal: Journal, say: Callable[[Cause], None], language: str
    ) -> None:
        self._place, self._bay, self._store = place, place.bay, store
        self._journal, self._say, self._language = journal, say, language
        self._read = False  # the persisted state is still being read
        self._timed: TimedStart | None = None
        self._first_s: float | None = None  # when it was refused first …
        self._again_s = 0.0  # … when it is tried again …
        self._why: Cause | None = None  # … and why it was refused last
        self._known = ""  # what a person had to look at already when it was asked for

    def due(self, clock: WallClock) -> Sequence[Asked]:
        """The start, if its time has come."""
        if not self._read:
            self._timed, self._read = self._store.past(self._place).timed, True
        timed = self._timed
        if timed is None or (late_s := clock.wall_s - timed.start_unix_s) < 0:
            return ()
        if timed.outcome is not None:
            if late_s > TOLD_S:
                self._timed = None
            return ()
        if late_s > MOST_LATE_S:
            self._fails(timed, Cause.of("start_too_late", late_min=late_s / 60), clock)
            return ()
        return (Asked.of(timed),) if clock.now_s >= self._again_s else ()

    def take(self, taken: Taken, last: Decision | None, clock: WallClock) -> Taken:
        """What is asked of the next decision, after the last one, with note taken of it."""
        needs_look = last is None or last.alarm is not Alarm.NONE
        if taken.noted is not None:
            self._cancel(cause_of(taken.noted, self._bay), clock)
            self._timed, self._first_s, self._again_s, self._why = taken.noted, None, 0.0, None
            self._known = last.cause.id if last is not None and needs_look else ""
        elif taken.request is Request.STOP:
            self._cancel(taken.by or Cause(NAMELESS[Request.STOP]), clock)
        elif taken.timed is not None and last is not None and needs_look and last.cause.id != self._known:
            return Taken(timed=taken.timed, refusal=taken.refusal or last.cause)
        return taken

    def decided(self, taken: Taken, answer: Cause | None, clock: WallClock) -> None:
        """Follow the decision: `answer` is why the request was refused."""
        why = taken.refusal or answer
        if taken.timed is not None and why is not None:
            self._first_s, self._again_s, self._why = self._first_s or clock.now_s, clock.now_s + AGAIN_S, why
            if clock.now_s - self._first_s >= PATIENCE_S:
                self._fails(taken.timed, why, clock)
        elif taken.request is Request.PAUSE and why is None:  # who does so now knows more than who asked for the start
            self._cancel(taken.by or Cause(NAMELESS[Request.PAUSE]), clock)
        elif taken.request is Request.START and why is None:
            if taken.timed is None:
                self._cancel(taken.by or Cause(NAMELESS[Request.START]), clock)
            elif (made := started_later(replace(taken.timed, by=_by(taken.timed)))) is not None:
                self._tell(made, clock)
            self._timed = None

    def withdraw(self, asked: Asked) -> None:
        """The disk has not taken this one: forget it."""
        if self._timed is not None and self._timed.start_unix_s == asked.start_unix_s:
            self._timed = None

    def kept(self, persisted: Persisted) -> Persisted:
        """This state, with the start that is to come."""
        return replace(persisted, timed=self._timed)

    def status(self, clock: WallClock) -> TimedStartFields | None:
        """Its part of the status document; `at` is Unix time. Any thread."""
        timed = self._timed
        if timed is None:
            return None
        return {
            **self._told(timed, clock),
            "at": timed.start_unix_s, "target_soc_pct": timed.target_pct, "pending": timed.outcome is None,
        }  # fmt: skip

    def next(self, decision: Decision, clock: WallClock) -> Waiting:
        """What comes next of a bay that waits for a start, in the status document: nobody needs to come. Any thread."""
        timed = self._timed
        if timed is None or not self._waits(decision):
            return {}
        at_s = None if self._first_s is not None else timed.start_unix_s  # a time that has passed is none to come
        return {"next": {**self._told(timed, clock), "at": at_s, "by_itself": True}}

    def _told(self, timed: TimedStart, clock: WallClock) -> ToldCause:
        tried_s, cause = self._first_s, cause_of(timed, self._bay)
        if timed.outcome is None and tried_s is not None:
            cause = replace(cause.with_(until_t_s=tried_s + PATIENCE_S, why=self._why), id="start_tried")
        return as_told(clock.told(cause), self._language)

    def told(self, decision: Decision) -> Decision:
        """The decision for people: of a bay that waits for a start they are not asked for one. Any thread."""
        return replace(decision, cause=without_then(decision.cause)) if self._waits(decision) else decision

    def _waits(self, decision: Decision) -> bool:
        """Whether nothing but the time is waited for."""
        if (timed := self._timed) is None or timed.outcome is not None:
            return False
        if decision.alarm is not Alarm.NONE and decision.cause.id != self._known:
            return False
        return decision.state is State.HELD or decision.cause.id in PAUSES

    def _fails(self, timed: TimedStart, why: Cause, clock: WallClock) -> None:
        self._timed = replace(timed, outcome=clock.told(why))  # without moments of a clock that a restart resets
        told = cause_of(self._timed, self._bay)
        self._tell(told, clock)
        self._say(Cause.of("bay_refused", bay=self._bay, why=clock.told(told)))

    def _cancel(self, why: Cause, clock: WallClock) -> None:
        """The start that is still to come, if there is one, shall not be made."""
        timed = self._timed
        if timed is None or timed.outcome is not None:
            return
        self._timed = replace(timed, outcome=Cause.of(CANCELLED, why=why))
        self._tell(cause_of(self._timed, self._bay), clock)

    def _tell(self, what: Cause, clock: WallClock) -> None:
        told = clock.told(what) or what
        said = {"text": say(told, self._language), "cause": plain(told)}
        self._journal.put(self._bay, ("timed_start", said), clock.now_s)


def cause_of(timed: TimedStart, bay: str) -> Cause:
    """What people read: when it starts, or why it did not, and who asked for it."""
    told = replace(_by(timed).with_(start_unix_s=timed.start_unix_s), id="starts_at")
    if timed.outcome is not None and timed.outcome.id == CANCELLED:  # the words of who has cancelled it stand there
        words = tuple(one for one in told.params if one[0] != "because")
        return Cause(CANCELLED, (*words, ("why", timed.outcome.param("why"))))
    if timed.outcome is not None:
        then = Cause.of("start_it_now", bay=bay)  # after the person's own words
        return replace(told.with_(why=timed.outcome, bay=bay, then=then), id="start_not_made")
    if timed.target_pct is not None:
        return replace(told.with_(target_pct=timed.target_pct), id="starts_at_to")
    return told


def _by(timed: TimedStart) -> Cause:
    return timed.by if timed.by is not None else Cause.of("started_by", who="?", asked_unix_s=timed.start_unix_s)
