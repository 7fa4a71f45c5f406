"""Requests to a charger, and the replies that count as their answers. Without I/O: frames out, bytes in, readings out.

A reply does not say which request it answers. To keep a late reply from being taken for the answer to the next request,
the request after a missed answer asks for a different number of values: its answer has a different length, which
exposes a late reply. The values that come and go are the two temperatures, which nobody uses.
"""

from enum import IntEnum

from orchestrator.errors import ProtocolError
from orchestrator.model import ChargerReading
from orchestrator.model.moment import moment
from orchestrator.protocol.charger import (
    STATUS_KINDS,
    Code,
    Kind1,
    Kinds,
    parse_error,
    parse_status,
    reply_bytes,
    status_request,
)
from orchestrator.protocol.frame import Frame, FrameDecoder

_KIND1, _KIND2 = STATUS_KINDS
#: Requests for 8, 9 and 10 values, in turn after each miss.
REQUESTS: tuple[Kinds, ...] = (
    STATUS_KINDS,
    (_KIND1 | Kind1.TEMPERATURE_1, _KIND2),
    (_KIND1 | Kind1.TEMPERATURE_1 | Kind1.TEMPERATURE_2, _KIND2),
)
_FRAMES = {kinds: status_request(*kinds) for kinds in REQUESTS}


class Heard(IntEnum):
    """The most significant input since the last good answer."""

    NOTHING = 0
    NOISE = 1
    ERROR_FRAME = 2
    LATE_REPLY = 3


#: The cause of a silence, by what was heard instead.
SILENCE = {
    Heard.NOTHING: "charger_no_reply",
    Heard.NOISE: "charger_noise",
    Heard.ERROR_FRAME: "charger_complains",
    Heard.LATE_REPLY: "charger_late",
}


class Dialogue:
    """The dialogue with one charger since its port was opened."""

    __slots__ = ("_asked_s", "_decoder", "_kinds", "_skipped", "error_bits", "error_t_s", "heard", "missing")

    def __init__(self) -> None:
        self._decoder = FrameDecoder()
        self._kinds = REQUESTS[0]
        self._asked_s: float | None = None  # None: no request is pending
        self.missing = 0  #: outstanding bytes of the answer
        self._skipped = 0  # bytes skipped by the decoder up to the last good answer
        self.heard = Heard.NOTHING
        self.error_bits = 0  #: of the newest 0x1F frame
        self.error_t_s: float | None = None  #: when it arrived

    @property
    def bad_frames(self) -> int:
        """Dropped frames: checksum, length, end."""
        return self._decoder.bad_frames

    def ask(self, now_s: float) -> bytes:
        """The request to send at `now_s`. Earlier input answers nothing any more."""
        self._take(self._decoder.flush(), now_s)
        self._asked_s = now_s
        self.missing = reply_bytes(*self._kinds)
        return _FRAMES[self._kinds]

    def hear(self, data: bytes, now_s: float) -> ChargerReading | None:
        """The answer to the last request, once these bytes complete it."""
        self.missing = max(0, self.missing - len(data))
        return self._take(self._decoder.feed(data), now_s)

    def give_up(self, now_s: float) -> ChargerReading | None:
        """Time is up: the answer, if it was hidden behind a false start; otherwise the next request will differ."""
        reading = self._take(self._decoder.flush(), now_s)
        if reading is None:
            self._asked_s = None
            self._kinds = REQUESTS[(REQUESTS.index(self._kinds) + 1) % len(REQUESTS)]
            if self._decoder.skipped_bytes > self._skipped:
                self.heard = max(self.heard, Heard.NOISE)
        return reading

    def _take(self, frames: list[Frame], now_s: float) -> ChargerReading | None:
        reading = None
        for frame in frames:
            if frame.command == Code.STATUS_REPLY:
                reading = self._reading(frame) or reading
            elif frame.command == Code.ERROR:
                self._complaint(frame, now_s)
            # Anything else is an echo of our own frame, or an acknowledgement that the document does not mention.
        return reading

    def _reading(self, frame: Frame) -> ChargerReading | None:
        if self._asked_s is not None:
            try:
                reading = parse_status(frame, self._kinds, moment(self._asked_s))
            except ProtocolError:
                pass  # the answer to another request
            else:
                self._asked_s = None
                self.heard, self._skipped = Heard.NOTHING, self._decoder.skipped_bytes
                return reading
        self.heard = Heard.LATE_REPLY
        return None

    def _complaint(self, frame: Frame, now_s: float) -> None:
        try:
            self.error_bits = int(parse_error(frame).bits)
        except ProtocolError:
            return  # not in the form of §3.3.5, so it means nothing
        self.error_t_s = now_s
        self.heard = max(self.heard, Heard.ERROR_FRAME)
