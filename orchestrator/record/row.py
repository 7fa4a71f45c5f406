"""A charge as a row of the index: what lists, reports and filters need of its record. Pure."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.record.lines import CHECKPOINT, END, Record
from orchestrator.record.stamp import figure, from_fields

#: Kinds of columns: a name, a number, a number that may be unknown, what is kept as JSON.
NAME, NUMBER, KNOWN, JSON = "name", "number", "known", "json"
TYPES = {NAME: "TEXT NOT NULL", NUMBER: "REAL NOT NULL", KNOWN: "REAL", JSON: "TEXT NOT NULL"}
#: Column → its kind, and where its value is in a record.
COLUMNS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "id": (NAME, ("id",)), "type": (NAME, ("type",)), "station": (NAME, ("station",)), "bay": (NAME, ("bay",)),
    "port": (NAME, ("port",)), "battery": (NAME, ("battery", "id")), "battery_source": (NAME, ("battery", "source")),
    "policy": (NAME, ("policy", "name")), "policy_sha256": (NAME, ("policy", "sha256")),
    "capacity_ah": (KNOWN, ("policy", "capacity_ah")), "software": (NAME, ("software",)), "by": (JSON, ("by",)),
    "begin_utc": (NAME, ("begin", "utc")), "begin_unix_s": (NUMBER, ("begin", "unix_s")),
    "begin_offset_min": (NUMBER, ("begin", "offset_min")),
    "last_utc": (NAME, ("last", "utc")), "last_unix_s": (NUMBER, ("last", "unix_s")),
    "last_offset_min": (NUMBER, ("last", "offset_min")),
    "lasted_s": (NUMBER, ("lasted_s",)), "energised_s": (NUMBER, ("energised_s",)),
    "paused_s": (NUMBER, ("paused_s",)), "pause_count": (NUMBER, ("pause_count",)),
    "charger_ah": (NUMBER, ("charger", "ah")), "charger_wh": (NUMBER, ("charger", "wh")),
    "bmu_ah": (NUMBER, ("bmu", "ah")), "bmu_wh": (NUMBER, ("bmu", "wh")),
    "soc_begin_pct": (KNOWN, ("values", "soc_pct", "begin")), "soc_end_pct": (KNOWN, ("values", "soc_pct", "end")),
    "soh_pct": (KNOWN, ("values", "soh_pct", "end")),
    "temperature_highest_c": (KNOWN, ("values", "temperature_c", "highest")),
    "step_changes": (NUMBER, ("step_changes",)), "stop_verified_ms": (KNOWN, ("stop_verified_ms",)),
    "result": (JSON, ("result",)), "pause": (JSON, ("pause",)), "faults": (JSON, ("faults",)),
    "stretch": (JSON, ("measured", "stretch")),
}  # fmt: skip
#: Of each fault; its cause stands in the record.
FAULT = ("id", "effect", "times")
#: Numbers of these columns have no fraction.
WHOLE = frozenset({"begin_offset_min", "last_offset_min", "pause_count", "step_changes"})


def as_row(record: Record) -> tuple[object, ...]:
    """The values of `COLUMNS`; ValueError if it is no whole record of a charge."""
    try:
        begin, last = from_fields(record["begin"]), from_fields(record["end" if record["type"] == END else "last"])
        faults = [{name: fault[name] for name in FAULT} for fault in record["faults"]]
        said = {
            **record,
            "last": record.get("end") or record["last"],
            "lasted_s": record.get("lasted_s", round(last.since(begin), 3)),
            "result": record.get("result"),
            "pause": open_pause(record),
            "faults": faults,
            "policy": {"capacity_ah": None, **record["policy"]},  # earlier versions have neither this …
            "measured": record.get("measured") or {"stretch": None},  # … nor that
        }
        return tuple(_value(kind, path, said) for kind, path in COLUMNS.values())
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise ValueError(f"a damaged record: {error!r}") from None


def open_pause(record: Record) -> Record | None:
    """The pause that has not ended; None if there is none."""
    last = next(reversed(record["pauses"]), None)
    return last if last is not None and last["lasted_s"] is None else None


def _value(kind: str, path: Sequence[str], record: Record) -> object:
    value: Any = record
    for name in path:
        if value is None and kind is KNOWN:
            return None
        value = value[name]
    if kind is JSON:
        return json.dumps(value, separators=(",", ":"))
    if kind is NAME:
        if not isinstance(value, str):
            raise ValueError(f"{value!r:.80} is no name")
        return value.encode(errors="backslashreplace").decode()
    return None if value is None and kind is KNOWN else figure(value)


def as_record(row: Sequence[Any]) -> dict[str, Any]:
    """The inverse, as far as the row goes. What ended has an `end`, what is open a `last`."""
    record: dict[str, Any] = {}
    for (column, (kind, path)), value in zip(COLUMNS.items(), row, strict=True):
        inside = record
        for name in path[:-1]:
            inside = inside.setdefault(name, {})
        inside[path[-1]] = _read(kind, column, value)
    for name in ("begin", "last"):
        record[name] |= {"mono_s": 0.0, "boot": ""}
    if record["type"] != CHECKPOINT:
        record["end"] = record.pop("last")
    values = record["values"]
    record["values"] = {name: None if None in one.values() else one for name, one in values.items()}
    return record


def _read(kind: str, column: str, value: Any) -> object:  # noqa: ANN401 - whatever the column has
    if kind is JSON:
        return json.loads(value)
    return int(value) if column in WHOLE else value
