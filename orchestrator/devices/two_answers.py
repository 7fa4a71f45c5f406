"""Two answers to one request: if they differ, neither is believed (FAULTS B26).

A BMU answers once. A second answer comes from a second node with the same id, or from a forger, and nothing on the wire
shows which of the two is the BMU's, whichever came first. Answers to other masters are legitimate: they count only if
they differ by more than any battery changes in the time between.
"""

from math import inf

from orchestrator.devices.sdo_client import Verdict
from orchestrator.model import Cause, Measurement
from orchestrator.protocol.objects import FieldMap, ObjectEntry
from orchestrator.protocol.sdo import SdoReply, SdoValue
from orchestrator.protocol.words import Decoded, decode_word

#: Answers to one request are the same, or measured milliseconds apart if we missed another master's request: they may
#: differ by this share of a field's range.
ONE_REQUEST = 0.002
#: An unrequested answer is compared with our newest one, up to this old, and may differ by this share.
UNASKED, UNASKED_S = 0.02, 2.0
#: The same for an answer requested by another master.
OTHERS, OTHERS_S = 0.05, 0.3
#: These do not change by that much in that time. Amperes, status bits and minutes may.
STEADY = frozenset({"voltage_v", "temperature_c", "soc_pct", "soh_pct", "remaining_ah", "available_wh"})
#: After two differing answers, no value of the object is believed for this long.
DOUBT_S = 10.0


class TwoAnswers:
    """The newest answer to a request for one object, and the doubts raised by others."""

    __slots__ = ("_doubts", "_doubts_s", "_entry", "_newest", "_newest_s")

    def __init__(self, entry: ObjectEntry) -> None:
        self._entry = entry
        self._newest: SdoValue | None = None
        self._newest_s = -inf
        self._doubts: dict[str, Cause] = {}
        self._doubts_s = -inf

    def took(self, reply: SdoValue, asked_s: float) -> None:
        """This one was accepted as the answer to a request of `asked_s`."""
        self._newest, self._newest_s = reply, asked_s

    def doubts(self, now_s: float) -> dict[str, Cause]:
        """Why the object's fields are not believed now; empty if they are."""
        if self._doubts and now_s - self._doubts_s >= DOUBT_S:
            self._doubts = {}
        return self._doubts

    def second(self, first: SdoReply, second: SdoReply, now_s: float, share: float = ONE_REQUEST) -> dict[str, Cause]:
        """Compare two answers to one request; returns the resulting doubts."""
        words = _fields(self._entry, first), _fields(self._entry, second)
        fields = [field for field in self._entry.fields if share == ONE_REQUEST or field.name in STEADY]
        apart = [field.name for field in fields if _apart(field, *words, share)]
        if not apart:
            return {}
        self._doubts_s = now_s
        self._doubts = {
            name: Cause.of("two_answers", field=name, one=_shown(words[0][name]), other=_shown(words[1][name]))
            if name in apart
            else Cause.of("two_answers_elsewhere", field=name, other=apart[0])
            for name in words[0]
        }
        return self._doubts

    def other(self, verdict: Verdict, first: SdoReply | None, reply: SdoReply, now_s: float) -> dict[str, Cause]:
        """Handle a rejected answer; returns the resulting doubts. `first`: the earlier answer, if this is a second."""
        if verdict is Verdict.SECOND and first is not None:
            return self.second(first, reply, now_s)
        if verdict is Verdict.STRAY:
            return self._held_against_newest(reply, now_s, UNASKED, UNASKED_S)
        if verdict is Verdict.THEIRS:
            return self._held_against_newest(reply, now_s, OTHERS, OTHERS_S)
        return {}

    def _held_against_newest(self, reply: SdoReply, now_s: float, share: float, age_s: float) -> dict[str, Cause]:
        if self._newest is None or now_s - self._newest_s > age_s or not isinstance(reply, SdoValue):
            return {}
        return self.second(self._newest, reply, now_s, share)


def _fields(entry: ObjectEntry, reply: SdoReply) -> dict[str, Decoded]:
    """What an answer says of each field; the same cause for each if it is none, or one of another size."""
    if isinstance(reply, SdoValue):
        return decode_word(entry, reply.value, reply.size, 0.0)
    return {field.name: Cause("a_refusal") for field in entry.fields}


def _shown(value: Decoded) -> float | Cause:
    return round(value.value, 1) if isinstance(value, Measurement) else value or Cause("not_available")


def _apart(field: FieldMap, first: dict[str, Decoded], second: dict[str, Decoded], share: float) -> bool:
    one, other = first[field.name], second[field.name]
    if isinstance(one, Measurement) and isinstance(other, Measurement):
        return abs(one.value - other.value) > share * (field.range.high - field.range.low)
    return one != other
