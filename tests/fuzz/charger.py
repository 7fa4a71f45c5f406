"""The charger's line: any bytes in any pieces, between requests and their deadlines."""

from contextlib import suppress

from orchestrator.devices.dialogue import SILENCE, Dialogue
from orchestrator.errors import ProtocolError
from orchestrator.model import ChargerReading
from orchestrator.model.moment import moment
from orchestrator.protocol.charger import parse_error, parse_status, parse_values, status_values
from orchestrator.protocol.frame import MAX_DATA, MAX_FRAME, Frame, FrameDecoder, why_bad
from orchestrator.protocol.standby import ANSWER_BYTES, stands_by
from tests.fuzz.target import Target, cut_records, kind_of_record, record, records
from tests.protocol.reference import frames_in, good_frame_at
from tests.protocol.vectors import CHARGER

#: Events: raw bytes, the same bytes framed, a request, its
#: deadline, a status reply, an error frame, an answer to the emergency stop's poll, and one to a request of any kind.
HEAR, FRAMED, ASK, GIVE_UP, STATUS, ERROR, STANDBY, KINDS = range(8)
HEADS = {STATUS: b"\x03\x90", ERROR: b"\x1f", STANDBY: b"\x03\x90", KINDS: b"\x03\x90", FRAMED: b"", HEAR: b""}
POLL_S = 0.2
MAX_REASON = 300  #: characters in the message about a broken frame


def framed(command_order_data: bytes) -> bytes:
    """Start, address, length, checksum and end around it (protocol 2/2, §3.1)."""
    counted = bytes((0x90, (len(command_order_data) + 1) & 0xFF)) + command_order_data
    return b"\xaf\xfa" + counted + bytes((sum(counted) & 0xFF,)) + b"\xaf\xa0"


class Session:
    """A dialogue, and a decoder whose whole stream is decoded again by one written from the document."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.asked_s: float | None = None
        self.kinds = (0, 0)
        self.dialogue, self.decoder = Dialogue(), FrameDecoder()
        self.stream = b""
        self.found: list[bytes] = []

    def event(self, kind: int, content: bytes) -> None:
        """The next event on the line."""
        if kind == ASK:
            self.now_s += POLL_S
            self.asked_s = self.now_s
            request = self.dialogue.ask(self.now_s)
            assert good_frame_at(request, 0) == len(request)
            self.kinds = (request[6], request[7])
        elif kind == GIVE_UP:
            self._is_honest(self.dialogue.give_up(self.now_s))
            self.asked_s = None
        elif kind == KINDS and len(content) >= 2:
            self.kinds = (content[0], content[1])
            self._hear(framed(HEADS[kind] + _sized(content[2:], self._values_bytes())))
        elif kind in (HEAR, KINDS):
            self._hear(content)
        else:
            sizes = {STATUS: self._values_bytes(), ERROR: 5, STANDBY: 6}
            self._hear(framed(HEADS[kind] + _sized(content, sizes.get(kind, max(2, len(content))))))

    def _values_bytes(self) -> int:
        return 2 * len(status_values(*self.kinds))

    def _hear(self, data: bytes) -> None:
        self._is_honest(self.dialogue.hear(data, self.now_s))
        self.stream += data
        self._parse(self.decoder.feed(data))
        assert len(self.decoder._pending) < MAX_FRAME

    def _parse(self, frames: list[Frame]) -> None:
        self.found += [frame.encode() for frame in frames]
        for frame in frames:
            assert len(frame.data) <= MAX_DATA
            with suppress(ProtocolError):
                assert parse_error(frame).bits == frame.order
            with suppress(ProtocolError):
                values = parse_values(frame, *self.kinds)
                assert len(values) == len(frame.data) // 2
            with suppress(ProtocolError):
                parse_status(frame, (self.kinds[0] | 0x13, self.kinds[1] | 0x1F), self.now_s)

    def _is_honest(self, reading: ChargerReading | None) -> None:
        """A reading has its request's time, and a value or a complaint for each field."""
        link = self.dialogue
        assert 0 <= link.missing <= MAX_FRAME and link.heard in SILENCE
        if reading is not None:
            assert self.asked_s is not None and reading.t_s == moment(self.asked_s)
            fields = [getattr(reading, name) for name in ChargerReading.__slots__ if name != "illegal"]
            assert fields.count(None) == len(reading.illegal)
            self.asked_s = None

    def end(self) -> None:
        """The line has gone quiet."""
        self._parse(self.decoder.flush())
        assert self.found == frames_in(self.stream)
        assert not self.decoder._pending
        assert self.decoder.skipped_bytes == len(self.stream) - sum(map(len, self.found))
        assert stands_by(self.stream) is _standby(self.stream)
        assert len(why_bad(b"\xaf\xfa" + self.stream)) <= MAX_REASON


def _standby(stream: bytes) -> bool | None:
    """`stands_by` written from the document: a good answer may begin anywhere, and the last one counts."""
    said, at = None, stream.find(b"\xaf\xfa")
    while at >= 0:
        if good_frame_at(stream, at) == ANSWER_BYTES and stream[at + 4 : at + 6] == b"\x03\x90":
            amps, operation = int.from_bytes(stream[at + 6 : at + 8], "big") / 100, stream[at + 10 : at + 12]
            said = operation == bytes(2) and amps <= 0.5
        at = stream.find(b"\xaf\xfa", at + 1)
    return said


def _sized(content: bytes, size: int) -> bytes:
    return content[:size].ljust(size, b"\0")


def one(data: bytes) -> None:
    """A session with one charger."""
    session = Session()
    for kind, content in records(data):
        session.event(kind, content)
    session.end()


def _story(wire: bytes) -> bytes:
    """A request, the bytes of one golden frame, and the deadline."""
    parts = b"".join(record(HEAR, wire[at : at + 31]) for at in range(0, len(wire), 31))
    return record(ASK) + parts + record(GIVE_UP)


_VALUES = bytes.fromhex("1393 0907 0001 0001 0002 0004 0000 0001")

TARGET = Target(
    one, cut_records, kind_of_record,
    [
        *(_story(vector.wire) for vector in CHARGER), record(ASK) + record(STATUS, _VALUES),
        record(STANDBY) + record(ERROR),
    ],
    [
        record(ASK), record(GIVE_UP), record(STATUS, _VALUES), record(STATUS, b"\xff" * 20), record(STANDBY),
        record(STANDBY, b"\0\x32"), record(STANDBY, b"\0\x33"), record(STANDBY, b"\0\0\0\0\0\1"),
        record(ERROR, b"\x0f"), record(FRAMED, b"\x03\x90" + bytes(12)), record(FRAMED, b"\x02\x90\x01\x01"),
        record(FRAMED, b"\xaf\xfa\xaf\xa0"), record(HEAR, b"\xaf"), record(HEAR, b"\xaf\xfa"),
        record(HEAR, b"\xaf\xfa\x90"), record(HEAR, b"\xaf\xfa\x90\x23"), record(HEAR, b"\xaf\xfa\x90\x03"),
        record(HEAR, b"\xaf\xfa\x90\x24"), record(HEAR, b"\xaf\xa0"), record(HEAR, b"\xaf\xaf\xfa"),
        record(HEAR, bytes(31)), record(KINDS, b"\xff\xff" + _VALUES),
    ],
    ["orchestrator/protocol/frame.py", "orchestrator/protocol/charger.py", "orchestrator/protocol/standby.py",
     "orchestrator/devices/dialogue.py"],
    max_bytes=128,
    limit_s=0.5,
)  # fmt: skip
