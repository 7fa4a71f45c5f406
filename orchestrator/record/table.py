"""The charges as a table for people, and as CSV for spreadsheets. Pure."""

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from orchestrator.columns import beside, folded, width_of
from orchestrator.model import Cause
from orchestrator.model.cause import from_plain, without_then
from orchestrator.model.identity import Source
from orchestrator.record.lasting import lasting
from orchestrator.record.lines import Record
from orchestrator.record.row import open_pause
from orchestrator.record.sections import heads
from orchestrator.record.stamp import Stamp, from_fields
from orchestrator.text.catalogue import say

#: With less room for the reason, it goes below its charge.
LEAST_WHY = 24
DASH = "–"
#: A spreadsheet in Korean takes UTF-8 for what it is only behind this.
BOM = "\ufeff"
#: What a spreadsheet takes for a formula, and for a number or a date.
FORMULA, LIKE_NUMBER = ("=", "+", "-", "@", "\t", "\r"), re.compile(r"[\s.,:/]*\d[\d\s.,:/%eE+-]*")


def table(charges: Sequence[Record], language: str, width: int) -> str:
    """One line a charge, where there is room."""
    rows = [heads("charges_head", language), *(_cells(charge, language) for charge in charges)]
    widths = [max(width_of(row[column]) for row in rows) for column in range(len(rows[0]) - 1)]
    lines = []
    for number, cells in enumerate(rows):
        fixed, why = beside(cells[:-1], widths, width), cells[-1]
        if width and width - width_of(fixed) < LEAST_WHY:
            lines += [fixed.rstrip(), *([folded(f"  {why}", width)] if number and why else [])]
        else:
            lines.append(folded(why, width, fixed).rstrip())
    return "\n".join(lines)


def _cells(charge: Record, language: str) -> tuple[str, ...]:
    battery, soc = charge.get("battery") or {}, (charge.get("values") or {}).get("soc_pct")
    return (
        began(charge)[:16],
        str(charge.get("bay", DASH)),
        str(battery.get("id", DASH)),
        say(lasting(length_s(charge)), language),
        f"{soc['begin']:.0f}→{soc['end']:.0f} %" if soc else DASH,
        f"{charge['charger']['ah']:.2f}",
        f"{charge['charger']['wh'] / 1000:.3f}",
        why_ended(charge, language),
    )


def why_ended(charge: Record, language: str) -> str:
    """The sentence for its result; of an open charge since when it has paused and why, or when it last was recorded."""
    if result := charge.get("result"):
        return sentence(result, language)
    pause = charge["pause"] if "pause" in charge else open_pause(charge)
    if pause is None:
        return say(Cause.of("charge_open", last_at=ended(charge)), language)
    since = from_fields(pause).local()
    return say(Cause.of("charge_paused", begin_at=since, why=sentence(pause["cause"], language)), language)


def sentence(cause: object, language: str) -> str:
    """The sentence for a cause in a record, without what came next; its data where it is not understood here."""
    try:
        return say(without_then(from_plain(cause)), language)
    except ValueError:
        return str(cause)


def began(charge: Record) -> str:
    """When it began, in the station's time."""
    return _stamp(charge, "begin").local()


def ended(charge: Record) -> str:
    """When it ended, or was last recorded, in the station's time."""
    return _stamp(charge, "end" if "end" in charge else "last").local()


def length_s(charge: Record) -> float:
    """How long it has lasted."""
    known = charge.get("lasted_s")
    return float(known) if known is not None else _stamp(charge, "last").since(_stamp(charge, "begin"))


def _stamp(charge: Record, name: str) -> Stamp:
    try:
        return from_fields(charge.get(name))
    except ValueError:
        return Stamp(0.0, 0, 0.0, "")


def value_rows(charge: Record, language: str) -> list[tuple[str, ...]]:
    """The measured values, as a table with its head; none if nothing was known."""
    known = charge.get("values") or {}
    rows = [
        (say(Cause(f"row_{name}"), language), *(f"{one[part]:g}" for part in ("begin", "end", "lowest", "highest")))
        for name, one in known.items()
        if one
    ]
    return [heads("values_head", language), *rows] if rows else []


#: The columns of the CSV: name → where it is in a record. The last ones are named as in OCPP 2.1's BatteryData.
COLUMNS = {
    "id": ("id",), "station": ("station",), "bay": ("bay",), "battery": ("battery", "id"),
    "battery_source": ("battery", "source"), "begin": ("begin", "utc"), "end": ("end", "utc"),
    "lasted_s": ("lasted_s",), "energised_s": ("energised_s",), "paused_s": ("paused_s",), "pauses": ("pause_count",),
    "charger_ah": ("charger", "ah"), "charger_wh": ("charger", "wh"), "bmu_ah": ("bmu", "ah"), "bmu_wh": ("bmu", "wh"),
    "soc_begin_pct": ("values", "soc_pct", "begin"), "soc_end_pct": ("values", "soc_pct", "end"),
    "soh_pct": ("values", "soh_pct", "end"), "temperature_highest_c": ("values", "temperature_c", "highest"),
    "step_changes": ("step_changes",), "policy": ("policy", "name"), "policy_sha256": ("policy", "sha256"),
    "by": ("by",), "result": ("result", "id"), "stop_verified_ms": ("stop_verified_ms",),
    "serialNumber": ("serialNumber",), "soC": ("values", "soc_pct", "end"), "soH": ("values", "soh_pct", "end"),
}  # fmt: skip


def as_csv(charges: Iterable[Record], language: str) -> Iterator[str]:
    """RFC 4180, line by line; causes are sentences, and the last column is why it ended."""
    yield BOM + _line([*COLUMNS, "why"])
    for charge in charges:
        named = {**charge, "serialNumber": _serial_number(charge.get("battery") or {})}
        found = [*(_found(named, path) for path in COLUMNS.values()), why_ended(charge, language)]
        yield _line([_guarded(sentence(value, language) if isinstance(value, dict) else value) for value in found])


def _serial_number(battery: Record) -> str | None:
    """The battery's, as its BMU tells it: what somebody has typed, or is assumed, is none."""
    return str(battery.get("id")) if battery.get("source") == Source.SERIAL_NUMBER.value else None


def _line(cells: Sequence[object]) -> str:
    text = io.StringIO()
    csv.writer(text).writerow(cells)
    return text.getvalue()


def _found(charge: Record, path: Sequence[str]) -> Any:  # noqa: ANN401 - whatever the record has there
    value: Any = charge
    for name in path:
        value = value.get(name) if isinstance(value, dict) else None
    return "" if value is None else value


def _guarded(value: object) -> object:
    """A name from a file is no formula, no number and no date: 0042 stays that, and 1E5, and 1-2."""
    if not isinstance(value, str):
        return value
    return f"'{value}" if value.startswith(FORMULA) or LIKE_NUMBER.fullmatch(value) else value
