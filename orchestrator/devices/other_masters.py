"""What other CANopen masters ask one node, so that the answers to it are not taken for something wrong.

The bus is shared: a service tool, a vehicle's controller or a second gateway may read and write the same BMU. Whatever
they ask is heard on the bus before its answer is. Each of their requests explains one answer; a transfer of many frames
explains them all. A node answers in the order of the requests, so an answer also ends what was asked before it.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from orchestrator.devices.sdo_client import Key
from orchestrator.model import Cause
from orchestrator.protocol.sdo import NmtCommand, SdoAbort, SdoMalformed, SdoReply, SdoWritten
from orchestrator.protocol.sdo_others import Ask, Part, SdoRequest, parse_part, parse_request, segment_number

FORGET_S = 2.0  #: what was not answered for so long is not answered any more
#: Between two masters the order of requests is only known to this: ours may have waited in a queue when theirs came.
ORDER_S = 0.05
TRANSFER_S = 0.2  #: a longer transfer that stood still for so long has ended
#: How long a request of ours lets a request, or a longer transfer, of others go first. Many nodes have room for one.
POLITE_S, POLITE_TRANSFER_S = 0.05, 0.2
SAY_S = 1.0  #: how often something new is said of them, unless it weighs more
MOST_OPEN = 256  #: requests that are remembered
_READS, _WRITES, _COMMANDS = range(3)  # how much what they do weighs
_OUT_OF_STEP = (0x0503, 0x0504)  #: upper half of an abort code: the protocol was not kept, whatever the object is
_AHEAD = 4  #: segments of a block that may be lost to us alone

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
    """A request of theirs that is not answered yet."""

    key: Key
    writes: bool
    t_s: float

    def fits(self, reply: SdoReply) -> bool:
        """Whether this may be its answer."""
        if isinstance(reply, SdoMalformed) or (reply.index, reply.sub) != self.key:
            return False
        return isinstance(reply, SdoAbort) or isinstance(reply, SdoWritten) == self.writes


class OtherMasters:
    """What they asked one node, and what they were last seen to do."""

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
        self._transfer: Key | None = None  # of their longer transfer
        self._transfer_s = -inf  # when its newest frame came
        self._going = False  # they asked for the next frame of a transfer; a node that knows of none aborts, each time
        self._going_s = -inf
        self._segment = 0  # the number of the next segment of a block that streams; 0: none does
        self._writing = False  # a block is being written: their frames are data
        self._polite_s: float | None = None  # since when a request of ours waits for theirs

    @property
    def going(self) -> bool:
        """Whether they have asked for a frame of a longer transfer lately."""
        return self._going

    @property
    def transferring(self) -> bool:
        """Whether a longer transfer of theirs goes on."""
        return self._transfer is not None

    @property
    def active(self) -> bool:
        """Whether an answer may be theirs."""
        return bool(self._open) or self._going or self._transfer is not None

    def clear(self) -> None:
        """The node booted: nothing is answered any more."""
        self._open.clear()
        self._forget_transfer()

    def _forget_transfer(self) -> None:
        """Nothing of a longer transfer comes any more."""
        self._going = False
        self._end()

    # --- what they ask --------------------------------------------------------------------------------------------

    def asked(self, data: bytes, now_s: float) -> SdoRequest | None:
        """A request that is not ours came; what it wants, if that can be told."""
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
        """An NMT command that is not ours, to this node or to all."""
        deed = _NMT_DEEDS.get(command)
        if deed:
            self._say(Cause.of(deed, whom="all_nodes" if everybody else "this_node"), now_s, _COMMANDS)

    def _say(self, said: Cause, now_s: float, weight: int) -> None:
        """What weighs more is said at once, all else when what was said has stood for SAY_S."""
        if weight > self._weight or now_s >= self.said_s + SAY_S:
            self.said, self.said_s, self._weight = said, now_s, weight

    # --- what is answered -----------------------------------------------------------------------------------------

    def owner(self, reply: SdoReply) -> Open | None:
        """Their oldest request that this may be the answer to."""
        return next((one for one in self._open if one.fits(reply)), None)

    def close(self, one: Open) -> None:
        """That one is answered, and what was asked before it is not answered any more."""
        while self._open and self._open.popleft() is not one:
            pass
        self._end()  # a node has one transfer at a time

    def ours_answered(self, asked_s: float) -> None:
        """An answer to a request of ours came: what they asked well before it is over, and so is their transfer."""
        self._end()
        while self._open and self._open[0].t_s < asked_s - ORDER_S:
            self._open.popleft()

    def in_transfer(self, data: bytes, now_s: float) -> bool:
        """Whether this reply is a frame of a longer transfer of theirs; then that goes on, or ends."""
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
        """Whether this abort ends their longer transfer; a node that we asked meanwhile may do that."""
        if not isinstance(reply, SdoAbort) or (reply.index, reply.sub) != self._transfer:
            return False
        self._end()
        return True

    def out_of_step(self, reply: SdoReply) -> bool:
        """Whether this abort is for a frame that should have continued a longer transfer; any object may be named."""
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
        """When a request of ours may go out at last: now, or somewhat later if one of theirs is being answered."""
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
