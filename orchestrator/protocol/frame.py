"""The charger's frames, without I/O: bytes in, frames out, and back (protocol 2/2, §3.1 and §3.2).

    AF FA | address | length | command | order | data … | checksum | AF A0

Nothing is escaped, so `AF FA` and `AF A0` may occur inside data. The decoder relies on the length, checks everything,
and after any error resumes its search one byte past the false start.
"""

from dataclasses import dataclass

from orchestrator.protocol.hextext import hex_of

START = b"\xaf\xfa"
END = b"\xaf\xa0"
ADDRESS = 0x90  #: fixed, the same for every charger (§3.2.3)
MAX_DATA = 32  #: 16 values of 2 bytes (§3.3.3); the "at most 20" of §3.2.7 is the ten defined ones
COUNTED = 3  #: command, order and checksum are counted in the length (§3.2.4)
OVERHEAD = 9  #: bytes in a frame besides its data
MAX_FRAME = MAX_DATA + OVERHEAD

_HEADER = 4  # start, address, length
_UNCOUNTED = OVERHEAD - COUNTED
_MAX_LENGTH = MAX_DATA + COUNTED

_BAD = -1
_INCOMPLETE = 0


def checksum(counted: bytes) -> int:
    """The low byte of the sum of these bytes: address, length, command, order and data (§3.2.6)."""
    return sum(counted) & 0xFF


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame's content. ValueError if it could not be sent: a byte outside 0 … 255, more than 32 data bytes."""

    command: int
    order: int  #: the address of the intended charger; in a 0x1F frame, the error bits
    data: bytes

    def __post_init__(self) -> None:
        if not (0 <= self.command <= 0xFF and 0 <= self.order <= 0xFF and len(self.data) <= MAX_DATA):
            raise ValueError(f"no frame can carry command {self.command}, order {self.order}, {len(self.data)} bytes")

    def encode(self) -> bytes:
        """The frame's bytes on the wire."""
        counted = bytes((ADDRESS, len(self.data) + COUNTED, self.command, self.order)) + self.data
        return START + counted + bytes((checksum(counted),)) + END

    def __str__(self) -> str:
        return hex_of(self.encode())


def declared_size(candidate: bytes) -> int | None:
    """The frame's declared size in bytes, from its start; None if the length is missing or invalid."""
    if len(candidate) >= _HEADER and COUNTED <= candidate[3] <= _MAX_LENGTH:
        return candidate[3] + _UNCOUNTED
    return None


def why_bad(candidate: bytes) -> str:
    """Everything wrong with bytes that begin with AF FA, expected and got; "" for a good frame."""
    if len(candidate) > len(START) and candidate[2] != ADDRESS:
        return f"address 0x{candidate[2]:02X}, expected 0x{ADDRESS:02X}"
    size = declared_size(candidate)
    if size is None:
        if len(candidate) < _HEADER:
            return f"incomplete: {len(candidate)} bytes, the smallest frame has {OVERHEAD}"
        return f"length 0x{candidate[3]:02X}, expected 0x{COUNTED:02X} … 0x{_MAX_LENGTH:02X}"
    if len(candidate) < size:
        return f"incomplete: {len(candidate)} bytes, its length 0x{candidate[3]:02X} makes it {size}"
    wrong = []
    end, said, summed = candidate[size - 2 : size], candidate[size - 3], checksum(candidate[2 : size - 3])
    if said != summed:
        wrong.append(f"checksum 0x{said:02X}, expected 0x{summed:02X}")
    if end != END:
        wrong.append(f"end {hex_of(end)}, expected {hex_of(END)}")
    return "; ".join(wrong)


def frame_size(data: bytes, at: int) -> int:
    """The size of the good frame that starts at `at`; 0 if it is incomplete, -1 if it is not a frame."""
    here = len(data) - at
    if here < _HEADER:
        return _BAD if here > len(START) and data[at + 2] != ADDRESS else _INCOMPLETE
    length = data[at + 3]
    if data[at + 2] != ADDRESS or not COUNTED <= length <= _MAX_LENGTH:
        return _BAD
    size = length + _UNCOUNTED
    if here < size:
        return _INCOMPLETE
    last = at + size
    if data[last - 2 : last] != END or sum(data[at + 2 : last - 3]) & 0xFF != data[last - 3]:
        return _BAD
    return size


class FrameDecoder:
    """Finds the good frames in a byte stream, however it is split; buffers less than one maximum-size frame.

    A false start can declare a length and wait for bytes that never come, while a good frame is already among the
    bytes received. When the line falls quiet (a gap, or the reply deadline), the caller calls `flush()`.
    """

    __slots__ = ("_pending", "bad_frames", "skipped_bytes")

    def __init__(self) -> None:
        self._pending = b""
        self.bad_frames = 0  #: starts not followed by a good frame
        self.skipped_bytes = 0  #: bytes outside good frames

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by these bytes, in order."""
        return self._hunt(self._pending + data, final=False)

    def flush(self) -> list[Frame]:
        """Stop waiting for the rest; return the good frames inside the pending bytes. Nothing is pending afterwards."""
        return self._hunt(self._pending, final=True)

    def _hunt(self, data: bytes, *, final: bool) -> list[Frame]:
        frames: list[Frame] = []
        done = 0  # everything before it is framed or skipped
        at = data.find(START)
        while at >= 0:
            size = frame_size(data, at)
            if size > 0:
                frames.append(Frame(data[at + 4], data[at + 5], data[at + 6 : at + size - 3]))
                self.skipped_bytes += at - done
                done = at + size
                at = data.find(START, done)
            elif size == _INCOMPLETE and not final:
                break
            else:
                self.bad_frames += 1
                at = data.find(START, at + 1)
        keep = at
        if at < 0:  # the last byte may be the first half of a start
            keep = len(data) - (not final and data.endswith(START[:1]))
        self.skipped_bytes += keep - done
        self._pending = data[keep:]
        return frames
