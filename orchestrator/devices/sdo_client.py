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

#: Reasons to refuse that only a write can have (CiA 301, table 22).
WRITE_ABORTS = frozenset({0x06010002, 0x06070010, 0x06070012, 0x06070013, 0x06090030, 0x06090031, 0x06090032})

HURRY_S = 0.05  #: what a node needs for an answer once nothing else is to be answered
QUIET_S = 1.0  #: far longer than a node that means to answer at all takes


class Verdict(Enum):
    """What an answer is worth."""

    ACCEPTED = auto()  #: it belongs to the request in flight, which is over
    LATE = auto()  #: to an earlier one, which had timed out
    SECOND = auto()  #: one more answer to a request that has one (`first`): a second node with this id, or a forger
    STRAY = auto()  #: to no request of ours, or not of its kind: as above
    THEIRS = auto()  #: to another master
    FRAGMENT = auto()  #: a frame of a longer transfer of another master, whatever it looks like
    UNCLEAR = auto()  #: to us or to another master: nobody can tell, and ours is given up
    MALFORMED = auto()  #: not an answer that we understand


class SdoClient:
    """At most one request in flight; the frames themselves are the caller's."""

    __slots__ = ("_answers", "_timeout_s", "asked_s", "deadline_s", "first", "pending", "quiet_s", "writing")

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        # The suspect objects in the order of their requests, and the first answer that came to each.
        self._answers: dict[Key, SdoReply | None] = {}
        self.first: SdoReply | None = None  #: what had been answered before, when `take()` says SECOND
        self.pending: Key | None = None
        self.writing = False  #: whether the newest request is a write
        self.asked_s = 0.0  #: when the newest request was made
        self.deadline_s = 0.0  #: when it is given up
        self.quiet_s = 0.0  #: when the suspects may be cleared if nothing is asked or answered until then

    def may_ask(self, key: Key) -> bool:
        """Nothing in flight, and no answer to an earlier request for this object can come."""
        return self.pending is None and key not in self._answers

    def ask(self, key: Key, now_s: float, *, write: bool = False) -> None:
        """A request for this object goes out now."""
        assert self.may_ask(key)
        self._answers[key] = None
        self.pending, self.writing, self.asked_s = key, write, now_s
        self.deadline_s = now_s + self._timeout_s
        self.quiet_s = self.deadline_s + QUIET_S

    def expire(self, now_s: float) -> bool:
        """Give the request in flight up if its time is over; True if that happened."""
        if self.pending is None or now_s < self.deadline_s:
            return False
        self.pending = None
        return True

    def hurry(self, now_s: float) -> None:
        """Give the request in flight up soon: the node was busy with another master's transfer and may have lost it."""
        self.deadline_s = min(self.deadline_s, now_s + HURRY_S)

    def drop(self) -> None:
        """Give the request in flight up: the bus broke. Its answer may still come."""
        self.pending = None

    def clear(self) -> None:
        """Nothing of any earlier request can come: the node booted, or was quiet until `quiet_s`."""
        self.pending = None
        self._answers.clear()

    def take(self, reply: SdoReply, now_s: float) -> Verdict:
        """What this answer is worth. Afterwards nothing that was asked before its request is suspect any more."""
        self.quiet_s = max(self.quiet_s, now_s + QUIET_S)
        if isinstance(reply, SdoMalformed):
            return Verdict.MALFORMED
        self.expire(now_s)
        key = (reply.index, reply.sub)
        if key not in self._answers or self._is_other_kind(key, reply):
            return Verdict.STRAY
        first = self._answers[key]
        for earlier in list(self._answers):
            if earlier == key:
                break
            del self._answers[earlier]
        if first is not None:
            self.first = first
            return Verdict.SECOND
        self._answers[key] = reply
        if key != self.pending:
            return Verdict.LATE
        self.pending = None
        return Verdict.ACCEPTED

    def claims(self, reply: SdoReply) -> bool:
        """Whether this may be the answer to the request in flight."""
        if isinstance(reply, SdoMalformed) or (reply.index, reply.sub) != self.pending:
            return False
        return not self._is_other_kind(self.pending, reply)

    def _is_other_kind(self, key: Key, reply: SdoReply) -> bool:
        """A value where the object is being written, or the other way round: somebody else's. So is a refusal to have
        it written where it is read."""
        if key != self.pending:
            return False
        if isinstance(reply, SdoAbort):
            return not self.writing and reply.code in WRITE_ABORTS
        return isinstance(reply, SdoWritten) != self.writing
