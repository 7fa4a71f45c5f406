"""One object of a BMU that is read periodically, and its latest value."""

from collections.abc import Mapping
from math import inf

from orchestrator.devices.sdo_client import Key
from orchestrator.devices.two_answers import TwoAnswers
from orchestrator.model import Cause, Measurement
from orchestrator.model.moment import moment
from orchestrator.protocol.objects import ObjectEntry
from orchestrator.protocol.sdo import SdoAbort, SdoValue
from orchestrator.protocol.words import Decoded, decode_word

Fields = Mapping[str, Decoded]

#: SDO and TPDO are two samples of one quantity, up to a second apart: they may differ by this share of its range …
TOLERANCE = 0.05
#: … and must differ by more in this many SDO reads, a second apart, before neither is believed …
CONFLICTS = 2
#: … while each agreement subtracts this much: a sender that lies every other time is also detected.
AGREED = 0.25


class Polled:
    """An object's schedule and its newest word."""

    __slots__ = ("_differed", "_tpdo_fields", "abort", "answers", "conflict", "due_s", "entry", "key", "tpdo_t_s")

    def __init__(self, entry: ObjectEntry) -> None:
        self.entry = entry
        self.key: Key = (entry.index, entry.sub)
        self.forget(due_s=-inf)

    def forget(self, due_s: float) -> None:
        """The node booted: its earlier values no longer count."""
        self.due_s = due_s  #: when to read it next
        self.abort: SdoAbort | None = None  #: set while the node refuses reads of it
        self.tpdo_t_s = -inf  #: when a TPDO last carried it
        self.conflict: dict[str, Decoded] = {}  #: fields in which SDO and TPDO disagree
        self.answers = TwoAnswers(self.entry)
        self._tpdo_fields: Fields = {}
        self._differed = 0.0

    def from_tpdo(self, word: int, now_s: float) -> Fields:
        """The fields, from the object's word in a TPDO received at `now_s`."""
        fields = decode_word(self.entry, word, self.entry.size, moment(now_s))
        self.tpdo_t_s, self._tpdo_fields = now_s, fields
        return self._doubted(fields, now_s)

    def from_sdo(self, reply: SdoValue, asked_s: float) -> Fields:
        """The fields, from an SDO answer to the request of `asked_s`. If TPDOs carry them as well, both must agree."""
        self.abort = None
        self.answers.took(reply, asked_s)
        fields = decode_word(self.entry, reply.value, reply.size, moment(asked_s))
        if self._tpdo_fields:
            different = self._different(fields)
            self._differed = min(CONFLICTS, self._differed + 1) if different else max(0.0, self._differed - AGREED)
            self.conflict = different if self._differed >= CONFLICTS else {}
            self._tpdo_fields = {}
        return self._doubted(fields, asked_s)

    def _doubted(self, fields: Fields, now_s: float) -> Fields:
        """The fields, with implausible ones replaced by the reasons."""
        doubts = self.answers.doubts(now_s)
        return {**fields, **self.conflict, **doubts} if self.conflict or doubts else fields

    def _different(self, fields: Fields) -> dict[str, Decoded]:
        different: dict[str, Decoded] = {}
        for field in self.entry.fields:
            tpdo, sdo = self._tpdo_fields.get(field.name), fields.get(field.name)
            if isinstance(tpdo, Measurement) and isinstance(sdo, Measurement):
                tolerance = TOLERANCE * (field.range.high - field.range.low)
                if abs(tpdo.value - sdo.value) > tolerance:
                    one, other = tpdo.value, sdo.value
                    different[field.name] = Cause.of("tpdo_contradicts", field=field.name, tpdo=one, sdo=other)
        return different
