"""One node's SDO exchanges, so that no answer is ever taken for one to another request.

SDO answers carry no number: a late one to an earlier read of the same object looks like a fresh one. What helps is that
a node answers in the order of the requests. So an object that was asked for stays *suspect*, whatever came of it, until
an answer to a request made after it shows that nothing of it can come any more; a suspect object is not asked again. In
a round of several objects this costs nothing. A node that answers nothing makes all its objects suspect; then QUIET_S
without a request clears them, which is right for any node that answers within its time-out plus QUIET_S, or never.
"""

from enum import Enum, auto

from orchestrator.protocol.sdo import SdoAbort, SdoMalformed, SdoReply, SdoWritten

Key = tuple[int, int]  #: index and sub-index

QUIET_S = 1.0  #: far longer than a node that means to answer at all takes


class Verdict(Enum):
    """What an answer is worth."""

    ACCEPTED = auto()  #: it belongs to the request in flight, which is over
    LATE = auto()  #: to an earlier one, which had timed out
    STRAY = auto()  #: the second to one request, or to none: a second node with this id, or another master
    MALFORMED = auto()  #: not an answer that we understand


class SdoClient:
    """At most one request in flight; the frames themselves are the caller's."""

    __slots__ = ("_answered", "_timeout_s", "asked_s", "deadline_s", "pending", "quiet_s", "writing")

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._answered: dict[Key, bool] = {}  # the suspect objects in the order of their requests: answered yet?
        self.pending: Key | None = None
        self.writing = False  #: whether the newest request is a write
        self.asked_s = 0.0  #: when the newest request was made
        self.deadline_s = 0.0  #: when it is given up
        self.quiet_s = 0.0  #: when the suspects may be cleared if nothing is asked or answered until then

    def may_ask(self, key: Key) -> bool:
        """Nothing in flight, and no answer to an earlier request for this object can come."""
        return self.pending is None and key not in self._answered

    def ask(self, key: Key, now_s: float, *, write: bool = False) -> None:
        """A request for this object goes out now."""
        assert self.may_ask(key)
        self._answered[key] = False
        self.pending, self.writing, self.asked_s = key, write, now_s
        self.deadline_s = now_s + self._timeout_s
        self.quiet_s = self.deadline_s + QUIET_S

    def expire(self, now_s: float) -> bool:
        """Give the request in flight up if its time is over; True if that happened."""
        if self.pending is None or now_s < self.deadline_s:
            return False
        self.pending = None
        return True

    def drop(self) -> None:
        """Give the request in flight up: the bus broke. Its answer may still come."""
        self.pending = None

    def clear(self) -> None:
        """Nothing of any earlier request can come: the node booted, or was quiet until `quiet_s`."""
        self.pending = None
        self._answered.clear()

    def take(self, reply: SdoReply, now_s: float) -> Verdict:
        """What this answer is worth. Afterwards nothing that was asked before its request is suspect any more."""
        self.quiet_s = max(self.quiet_s, now_s + QUIET_S)
        if isinstance(reply, SdoMalformed):
            return Verdict.MALFORMED
        self.expire(now_s)
        key = (reply.index, reply.sub)
        answered = self._answered.get(key)
        if answered is None or self._is_other_kind(key, reply):
            return Verdict.STRAY
        for earlier in list(self._answered):
            if earlier == key:
                break
            del self._answered[earlier]
        self._answered[key] = True
        if answered:
            return Verdict.STRAY
        if key != self.pending:
            return Verdict.LATE
        self.pending = None
        return Verdict.ACCEPTED

    def _is_other_kind(self, key: Key, reply: SdoReply) -> bool:
        """A value where the object is being written, or the other way round: somebody else's."""
        return key == self.pending and not isinstance(reply, SdoAbort) and isinstance(reply, SdoWritten) != self.writing
