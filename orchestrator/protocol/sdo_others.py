"""SDO frames of other masters: which object they request, and how their longer transfers proceed (CiA 301, §7.2.4).

We never use these transfers; we only need to know which request a reply belongs to.
"""

from dataclasses import dataclass
from enum import Enum, auto

from orchestrator.protocol.sdo import FRAME_BYTES


class Ask(Enum):
    """What a request asks for."""

    READ = auto()
    WRITE = auto()
    BLOCK_READ = auto()
    BLOCK_WRITE = auto()
    STREAM = auto()  #: "send the next block": numbered segments follow in sequence
    ON = auto()  #: the next frame of a running transfer
    ABORT = auto()


@dataclass(frozen=True, slots=True)
class SdoRequest:
    """A request to a node; `index` and `sub` are meaningless for STREAM and ON."""

    ask: Ask
    index: int = 0
    sub: int = 0
    timer_ms: int | None = None  #: the value written, if it is an expedited 16-bit value


_BY_SPECIFIER = {0: Ask.ON, 1: Ask.WRITE, 2: Ask.READ, 3: Ask.ON, 4: Ask.ABORT}
_BLOCK_READ = {0: Ask.BLOCK_READ, 1: Ask.ON, 2: Ask.STREAM, 3: Ask.STREAM}
_U16 = 0x2B


def parse_request(data: bytes) -> SdoRequest | None:
    """Decode a frame on a node's request COB-ID; None if it is not an SDO request."""
    if len(data) != FRAME_BYTES:
        return None
    specifier = data[0] >> 5
    if specifier == 5:
        ask = _BLOCK_READ[data[0] & 3]
    elif specifier == 6:
        ask = Ask.ON if data[0] & 1 else Ask.BLOCK_WRITE
    elif specifier in _BY_SPECIFIER:
        ask = _BY_SPECIFIER[specifier]
    else:
        return None
    if ask in (Ask.STREAM, Ask.ON):
        return SdoRequest(ask)
    timer_ms = int.from_bytes(data[4:6], "little") if data[0] == _U16 else None
    return SdoRequest(ask, data[1] | data[2] << 8, data[3], timer_ms)


class Part(Enum):
    """The meaning of a reply that is not expedited."""

    BEGIN = auto()  #: a longer transfer of the object begins
    MORE = auto()  #: one frame of it
    LAST = auto()  #: its last one


@dataclass(frozen=True, slots=True)
class SdoPart:
    """A reply within a longer transfer; `index` and `sub` are meaningful for BEGIN only."""

    part: Part
    index: int = 0
    sub: int = 0


_BLOCK_WRITTEN = {0: Part.BEGIN, 1: Part.LAST, 2: Part.MORE}


def parse_part(data: bytes) -> SdoPart | None:
    """Decode a reply within a longer transfer; None if it is an expedited reply, or not a reply.

    Segments of a block read carry no marker: a caller that knows one is streaming uses `segment_number`.
    """
    if len(data) != FRAME_BYTES:
        return None
    specifier, index, sub = data[0] >> 5, data[1] | data[2] << 8, data[3]
    if specifier == 0:  # a segment that was read; bit 0: no more
        return SdoPart(Part.LAST if data[0] & 1 else Part.MORE)
    if specifier == 1:  # a segment was written
        return SdoPart(Part.MORE)
    if data[0] in (0x40, 0x41, 0x42):  # segmented, or expedited without its size
        return SdoPart(Part.BEGIN, index, sub)
    if specifier == 5:  # block write: begun, a block arrived, ended
        return SdoPart(_BLOCK_WRITTEN.get(data[0] & 3, Part.MORE), index, sub)
    if specifier == 6:  # block read: begun; ended
        return SdoPart(Part.LAST if data[0] & 1 else Part.BEGIN, index, sub)
    return None


def segment_number(data: bytes) -> int:
    """The sequence number of a block segment, 1 … 127; 0 for what can be none, such as a frame that is too short."""
    return data[0] & 0x7F if len(data) == FRAME_BYTES else 0
