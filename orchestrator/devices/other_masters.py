"""Tracks other CANopen masters' requests to one node, so that the answers to them are not mistaken for errors.

The bus is shared: a service tool, a vehicle's controller or a second gateway may read and write the same BMU. Each of
their requests is seen on the bus before its answer, and explains one answer; a transfer of many frames explains them
all. A node answers in the order of the requests, so an answer also closes the requests before it.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from orchestrator.devices.sdo_client import Key
from orchestrator.model import Cause
from orchestrator.protocol.sdo import NmtCommand, SdoAbort, SdoMalformed, SdoReply, SdoWritten
from orchestrator.protocol.sdo_others import Ask, Part, SdoRequest, parse_part, parse_request, segment_number

FORGET_S = 2.0  #: a request unanswered for this long stays unanswered
#: The uncertainty of the request order between two masters: ours may have been queued when theirs arrived.
ORDER_S = 0.05
TRANSFER_S = 0.2  #: a longer transfer that stalls for this long has ended
#: How long our request lets others' requests, or a longer transfer, go first. Many nodes handle only one at a time.
POLITE_S, POLITE_TRANSFER_S = 0.05, 0.2
SAY_S = 1.0  #: how often their newest activity is reported, unless it weighs more
MOST_OPEN = 256  #: remembered requests
_READS, _WRITES, _COMMANDS = range(3)  # the weight of their activities
_OUT_OF_STEP = (0x0503, 0x0504)  #: upper half of an abort code: a protocol violation, whatever the object is
_AHEAD = 4  #: segments of a block that only we may have missed

_DEEDS = {
    Ask.READ: "master_reads", Ask.BLOCK_READ: "master_reads",
    Ask.WRITE: "master_writes", Ask.BLOCK_WRITE: "master_writes",
}  # fmt: skip
_NMT_DEEDS: Mapping[int, str] = {
    NmtCommand.START: "master_started",
    NmtCommand.STOP: "master_stopped",
    NmtCommand.PREOPERATIONAL: "master_preoperational",
    NmtCommand.RESET_NODE: "master_reset",
    NmtCommand.RESET_COMMUNICATION: "master_reset_communication",
}


@dataclass(frozen=True, slots=True)
class Open:
    """Another master's unanswered request."""

    key: Key
    writes: bool
    t_s: float

    def fits(self, reply: SdoReply) -> bool:
        """Whether this may be the answer."""
        if isinstance(reply, SdoMalformed) or (reply.index, reply.sub) != self.key:
            return False
        return isinstance(reply, SdoAbort) or isinstance(reply, SdoWritten) == self.writes


class OtherMasters:
    """Other masters' requests to one node, and their latest activity."""

    __slots__ = (
        "_going",
        "_going_s",
        "_open",
        "_polite_s",
        "_segment",
        "_transfer",
        "_transfer_s",
        "_weight",
        "_writing",
        "said",
        "said_s",
    )

    def __init__(self) -> None:
        self.said: Cause | None = None  #: what another master was last seen to do
        self.said_s = -inf  #: when
        self._weight = _READS
        self._open: deque[Open] = deque(maxlen=MOST_OPEN)
        self._transfer: Key | None = None  # the object of their longer transfer
        self._transfer_s = -inf  # when its newest frame arrived
        self._going = False  # they asked for the next frame of a transfer; a node without one aborts, each time
        self._going_s = -inf
        self._segment = 0  # the number of the next segment of a streaming block; 0: none is streaming
        self._writing = False  # a block is being written: their frames are data
        self._polite_s: float | None = None  # since when our request has been waiting for theirs

    @property
    def going(self) -> bool:
        """Whether they have recently asked for a frame of a longer transfer."""
        return self._going

    @property
    def transferring(self) -> bool:
        """Whether a longer transfer of theirs is in progress."""
        return self._transfer is not None

    @property
    def active(self) -> bool:
        """Whether an answer may be theirs."""
        return bool(self._open) or self._going or self._transfer is not None

    def clear(self) -> None:
        """The node booted: nothing will be answered any more."""
        self._open.clear()
        self._forget_transfer()

    def _forget_transfer(self) -> None:
        """Their longer transfer is over."""
        self._going = False
        self._end()

    # --- what they ask --------------------------------------------------------------------------------------------

    def asked(self, data: bytes, now_s: float) -> SdoRequest | None:
        """Handle another master's request; returns it decoded, if possible."""
        self._age(now_s)
        request = parse_request(data)
        if self._writing and (request is None or request.ask is not Ask.ABORT):
            self._transfer_s = now_s  # data, whatever it looks like
            return None
        if request is None:
            return None
        if request.ask in (Ask.STREAM, Ask.ON):
            self._transfer_s = self._going_s = now_s
            self._going = True
            if request.ask is Ask.STREAM:
                self._segment = 1
            return request
        key = request.index, request.sub
        if request.ask is Ask.ABORT:
            self._end()
            return request
        writes = request.ask in (Ask.WRITE, Ask.BLOCK_WRITE)
        self._open.append(Open(key, writes, now_s))
        deed = Cause.of(_DEEDS[request.ask], index=request.index, sub=request.sub)
        self._say(deed, now_s, _WRITES if writes else _READS)
        return request

    def commanded(self, command: int, now_s: float, *, everybody: bool) -> None:
        """Handle another master's NMT command, to this node or to all."""
        deed = _NMT_DEEDS.get(command)
        if deed:
            self._say(Cause.of(deed, whom="all_nodes" if everybody else "this_node"), now_s, _COMMANDS)

    def _say(self, said: Cause, now_s: float, weight: int) -> None:
        """Report weightier activity at once, and other activity once the last report is SAY_S old."""
        if weight > self._weight or now_s >= self.said_s + SAY_S:
            self.said, self.said_s, self._weight = said, now_s, weight

    # --- what is answered -----------------------------------------------------------------------------------------

    def owner(self, reply: SdoReply) -> Open | None:
        """Their oldest request that this may answer."""
        return next((one for one in self._open if one.fits(reply)), None)

    def close(self, one: Open) -> None:
        """That one is answered, and requests before it will not be answered any more."""
        while self._open and self._open.popleft() is not one:
            pass
        self._end()  # a node has one transfer at a time

    def ours_answered(self, asked_s: float) -> None:
        """Our request was answered: requests of theirs well before it are over, and so is their transfer."""
        self._end()
        while self._open and self._open[0].t_s < asked_s - ORDER_S:
            self._open.popleft()

    def in_transfer(self, data: bytes, now_s: float) -> bool:
        """Whether this reply is a frame of their longer transfer, which then continues or ends."""
        self._age(now_s)
        if self._streams(data, now_s):
            return True
        part = parse_part(data)
        if part is None:
            return False
        if part.part is Part.BEGIN:
            return self._begins((part.index, part.sub), data, now_s)
        if self._transfer is None:
            return self._going
        self._transfer_s = now_s
        if part.part is Part.LAST:
            self._end()
        return True

    def breaks_off(self, reply: SdoReply) -> bool:
        """Whether this abort ends their longer transfer; our own request may cause a node to do that."""
        if not isinstance(reply, SdoAbort) or (reply.index, reply.sub) != self._transfer:
            return False
        self._end()
        return True

    def out_of_step(self, reply: SdoReply) -> bool:
        """Whether this abort answers a frame that should have continued a longer transfer; it may name any object."""
        return self._going and isinstance(reply, SdoAbort) and reply.code >> 16 in _OUT_OF_STEP

    def _streams(self, data: bytes, now_s: float) -> bool:
        if not self._segment or self._segment > segment_number(data) or segment_number(data) >= self._segment + _AHEAD:
            return False
        self._segment = segment_number(data) + 1
        self._transfer_s = now_s
        return True

    def _begins(self, key: Key, data: bytes, now_s: float) -> bool:
        one = next((one for one in self._open if one.key == key), None)
        if one is None:
            return False
        self.close(one)
        self._transfer, self._transfer_s, self._segment = key, now_s, 0
        self._writing = data[0] >> 5 == 5
        return True

    # --- whose turn it is -----------------------------------------------------------------------------------------

    def wait_until_s(self, now_s: float) -> float:
        """When our request may go out: now, or somewhat later if one of theirs is being answered."""
        if not self.active:
            self._polite_s = None
            return now_s
        self._age(now_s)
        if self._transfer is not None:
            newest_s, polite_s = self._transfer_s, POLITE_TRANSFER_S
        else:
            newest_s, polite_s = (self._open[-1].t_s if self._open else -inf), POLITE_S
        if self._polite_s is None:
            self._polite_s = now_s
        until_s = min(newest_s, self._polite_s) + polite_s
        if until_s > now_s:
            return until_s
        self._polite_s = None
        return now_s

    def _age(self, now_s: float) -> None:
        while self._open and now_s - self._open[0].t_s > FORGET_S:
            self._open.popleft()
        if self._going and now_s - self._going_s > FORGET_S:
            self._forget_transfer()
        if self._transfer is not None and now_s - self._transfer_s > TRANSFER_S:
            self._end()

    def _end(self) -> None:
        self._transfer, self._segment, self._writing = None, 0, False
