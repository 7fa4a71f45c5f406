"""One node's SDO exchanges: ensures that no answer is taken for the answer to another request.

SDO answers carry no sequence number: a late answer to an earlier read of the same object looks like a fresh one.
However, a node answers in the order of the requests. So a requested object stays *suspect* until a reply to a later
request proves that its own reply can no longer arrive; a suspect object is not requested again. In a round of several
objects this costs nothing. A node that answers nothing makes all its objects suspect; then QUIET_S without a request
clears them, which is correct for any node that answers within its time-out plus QUIET_S, or never.
"""

from enum import Enum, auto

from orchestrator.protocol.sdo import SdoAbort, SdoMalformed, SdoReply, SdoWritten

Key = tuple[int, int]  #: index and sub-index

#: Abort codes that only a write can cause (CiA 301, table 22).
WRITE_ABORTS = frozenset({0x06010002, 0x06070010, 0x06070012, 0x06070013, 0x06090030, 0x06090031, 0x06090032})

HURRY_S = 0.05  #: how long a node takes to answer once nothing else is pending
QUIET_S = 1.0  #: far longer than any node takes that answers at all


class Verdict(Enum):
    """The classification of an answer."""

    ACCEPTED = auto()  #: it answers the request in flight, which is then over
    LATE = auto()  #: it answers an earlier request, which had timed out
    SECOND = auto()  #: another answer to an answered request (`first`): a second node with this id, or a forger
    STRAY = auto()  #: it answers no request of ours, or is of the wrong kind: as above
    THEIRS = auto()  #: it answers another master
    FRAGMENT = auto()  #: a frame of another master's longer transfer, whatever it looks like
    UNCLEAR = auto()  #: it may be for us or for another master: ours is given up
    MALFORMED = auto()  #: an answer that we do not understand


class SdoClient:
    """At most one request in flight; the caller handles the frames themselves."""

    __slots__ = ("_answers", "_timeout_s", "asked_s", "deadline_s", "first", "pending", "quiet_s", "writing")

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        # The suspect objects in the order of their requests, and the first answer to each.
        self._answers: dict[Key, SdoReply | None] = {}
        self.first: SdoReply | None = None  #: the earlier answer, if `take()` returns SECOND
        self.pending: Key | None = None
        self.writing = False  #: whether the newest request is a write
        self.asked_s = 0.0  #: when the newest request was made
        self.deadline_s = 0.0  #: when it will be given up
        self.quiet_s = 0.0  #: when the suspects may be cleared, if nothing is requested or answered until then

    def may_ask(self, key: Key) -> bool:
        """Nothing is in flight, and no answer to an earlier request for this object can arrive."""
        return self.pending is None and key not in self._answers

    def ask(self, key: Key, now_s: float, *, write: bool = False) -> None:
        """A request for this object goes out now."""
        assert self.may_ask(key)
        self._answers[key] = None
        self.pending, self.writing, self.asked_s = key, write, now_s
        self.deadline_s = now_s + self._timeout_s
        self.quiet_s = self.deadline_s + QUIET_S

    def expire(self, now_s: float) -> bool:
        """Give up the request in flight if its time is over; True if that happened."""
        if self.pending is None or now_s < self.deadline_s:
            return False
        self.pending = None
        return True

    def hurry(self, now_s: float) -> None:
        """Give up the request in flight soon: the node was busy with another master's transfer and may have lost it."""
        self.deadline_s = min(self.deadline_s, now_s + HURRY_S)

    def drop(self) -> None:
        """Give up the request in flight: the bus broke. Its answer may still arrive."""
        self.pending = None

    def clear(self) -> None:
        """No answer to an earlier request can arrive: the node booted, or was quiet until `quiet_s`."""
        self.pending = None
        self._answers.clear()

    def take(self, reply: SdoReply, now_s: float) -> Verdict:
        """Classify this answer. Afterwards no object requested before it is suspect any more."""
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
        """Whether it is a value although the object is being written, or the reverse: then it is somebody else's. So is
        the refusal of a write while we are reading."""
        if key != self.pending:
            return False
        if isinstance(reply, SdoAbort):
            return not self.writing and reply.code in WRITE_ABORTS
        return isinstance(reply, SdoWritten) != self.writing
