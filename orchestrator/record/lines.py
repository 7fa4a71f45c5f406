"""The records of a charge: one JSON object on a line. Pure.

`begin` has what does not change, a `checkpoint` what has been counted until then, `end` both: whoever wants a finished
charge needs its last line alone. `n` numbers the records of a charge: the highest is the newest, whatever the clock has
done, and the same one twice is one.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from orchestrator.record import amounts, forecast, measured, met, pauses, spread
from orchestrator.record import stamp as stamps
from orchestrator.record.charge import Charge
from orchestrator.record.ulid import is_ulid

#: Of these records.
VERSION = 1
BEGIN, CHECKPOINT, END = "begin", "checkpoint", "end"
#: How a charge ends that was not cut short.
FULL = "full"
#: The member that tells of other policies in mid-charge; earlier versions had none.
CHANGES = "changes"

Record = Mapping[str, Any]
#: With what each line begins, so that most need not be decoded: one out of ten records is no checkpoint.
_BEGINNING = re.compile(rb'\{"type":"(begin|checkpoint|end)","id":"([0-9A-Z]{26})","n":(\d{1,9}),')


def begin(charge: Charge) -> Record:
    """The record of its begin."""
    return {**_name(charge, BEGIN), **_head(charge), **_counted(charge)}


def checkpoint(charge: Charge) -> Record:
    """The record of what has been counted until now."""
    return {**_name(charge, CHECKPOINT), **_counted(charge)}


def end(charge: Charge) -> Record:
    """The record of the whole charge."""
    lasted_s = round(charge.last.since(charge.begin), 3)
    said = {"end": stamps.as_fields(charge.last), "lasted_s": lasted_s, "result": charge.result}
    counted = {name: value for name, value in _counted(charge).items() if name != "last"}
    if (foreseen := counted[forecast.NAME]) is not None and (charge.result or {}).get("id") == FULL:
        counted[forecast.NAME] = {**foreseen, "took_min": forecast.took_min(charge.forecast, lasted_s)}
    return {**_name(charge, END), **_head(charge), **said, **counted}


def _name(charge: Charge, kind: str) -> Record:
    return {"type": kind, "id": charge.id, "n": charge.number}


def _head(charge: Charge) -> Record:
    return {"version": VERSION, **charge.head, "begin": stamps.as_fields(charge.begin)}


def _counted(charge: Charge) -> dict[str, Any]:
    contactor = charge.head.get("contactor_fitted")
    return {
        "last": stamps.as_fields(charge.last),
        "started_s": charge.started_s,
        "soc_start_pct": charge.soc_start_pct,
        **amounts.as_fields(charge.amounts),
        "values": spread.as_fields(charge.spreads),
        **pauses.as_fields(charge.pauses),
        **met.as_fields(charge.trouble),
        **measured.as_fields(charge.measured),
        **forecast.as_fields(charge.forecast),
        CHANGES: list(charge.changes),
        "contactor_closed": charge.closed if contactor else None,
    }


def restored(first: Record, newest: Record) -> Charge:
    """The open charge of these two records, which may be the same; ValueError if they are none."""
    try:
        if not is_ulid(newest["id"]) or first["id"] != newest["id"] or first["type"] == CHECKPOINT:
            raise ValueError(f"no records of one charge: {first!r:.80}, {newest!r:.80}")
        last, soc_pct = stamps.from_fields(newest["end" if newest["type"] == END else "last"]), newest["soc_start_pct"]
        head = {name: first[name] for name in HEAD}
        return Charge(
            newest["id"],
            head,
            stamps.from_fields(first["begin"]),
            last,
            last,
            stamps.figure(newest["started_s"]),
            None if soc_pct is None else stamps.figure(soc_pct),
            int(stamps.figure(newest["n"])) + 1,
            amounts.from_fields(newest),
            spread.from_fields(newest["values"]),
            pauses.from_fields(newest),
            met.from_fields(newest),
            measured.from_fields(newest),
            forecast.from_fields(newest),
            tuple(map(dict, newest.get(CHANGES, ()))),
            newest["contactor_closed"] is True,
        )
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise ValueError(f"a damaged record: {error!r}") from None


#: What a record says of the charge as such.
HEAD = ("station", "bay", "port", "battery", "policy", "software", "by", "contactor_fitted")


def encoded(record: Record) -> bytes:
    """The line. Whatever a cause may hold, it never fails: one record must not keep others from the disk."""
    text = json.dumps(record, ensure_ascii=False, separators=(",", ":"), default=str)
    return text.encode(errors="backslashreplace") + b"\n"


def decoded(line: bytes) -> Record | None:
    """The record on a line; None for a torn or foreign one."""
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(record, dict) or record.get("type") not in (BEGIN, CHECKPOINT, END):
        return None
    number = record.get("n")
    return record if is_ulid(record.get("id")) and isinstance(number, int) and number >= 0 else None


class Scanned(NamedTuple):
    """A line that looks like a record; it may be torn."""

    kind: str
    id: str
    n: int
    at: int  #: where it begins, in bytes
    text: bytes


def scanned(lines: Iterable[bytes], at: int = 0) -> Iterator[Scanned]:
    """Those of these lines that look like records; the first one begins at `at`."""
    for line in lines:
        if (found := _BEGINNING.match(line)) is not None:
            yield Scanned(found[1].decode(), found[2].decode(), int(found[3]), at, line)
        at += len(line)
