"""The snapshots in a record of many, one after another: the inverse of `service/rows.py`."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

from orchestrator.core.parts import changed, made
from orchestrator.model import BatteryReading, Measurement, Snapshot
from orchestrator.service.journal_files import Fields
from orchestrator.workbench.replay.converting import ALL_NUMBERS, BATTERY_TIMES, MAKERS, PLACES

#: No record has more rows; more would be somebody's joke.
MOST = 100_000
_NONE = SimpleNamespace(value=None, t_s=None)  # no measurement
Changes = dict[str, Any]  #: column → new value


def rows_of(line: Fields, base: Snapshot) -> Iterator[tuple[float, Snapshot]]:
    """Each decision's time and snapshot; `base` is the snapshot right before them."""
    times, changes = _times(line), _changes(line, base)
    for at_s, change in zip(times, changes, strict=True):
        base = _after(base, change) if change else base
        yield at_s, base


def _times(line: Fields) -> list[float]:
    times = [float(line["t"])]
    for step in line["at"]:
        times.append(_grown(times[-1], step))
    return times


def _grown(old: float | None, step: float | None) -> Any:  # noqa: ANN401 - a time, or None
    """The time that was written as `step` after the time `old`."""
    return (round((old or 0.0) * 1000) + step) / 1000 if step.__class__ is int else step


def _changes(line: Fields, base: Snapshot) -> list[Changes]:
    """What each row changes."""
    rows: list[Changes] = [{} for _ in range(len(line["at"]) + 1)]
    for column, entries in line.items():
        if column in ALL_NUMBERS:
            steps = line[entries] if entries.__class__ is str else entries
            last = _number_in(base, column)
            for number, step in enumerate(steps):
                if step != 0 or step.__class__ is float:
                    rows[number][column] = last = _grown(last, step)
        elif column in MAKERS:
            make = MAKERS[column]
            for number, value in zip(entries[::2], entries[1::2], strict=True):
                rows[number][column] = None if value is None else make(value)
    return rows


def _number_in(base: Snapshot, column: str) -> float | None:
    part, name = PLACES[column]
    value = getattr(getattr(base, part), name, None)
    if isinstance(value, Measurement):
        return value.t_s if column in BATTERY_TIMES else value.value
    return value


def _after(base: Snapshot, changes: Changes) -> Snapshot:
    parts: dict[str, Changes] = {}
    own: Changes = {}
    battery: dict[str, dict[str, Any]] = {}
    for column, value in changes.items():
        part, name = PLACES[column]
        if part == "battery":
            battery.setdefault(name, {})["t_s" if column in BATTERY_TIMES else "value"] = value
        elif part:
            parts.setdefault(part, {})[name] = value
        else:
            own[name] = value
    if battery:
        own["battery"] = _battery(base.battery, battery)
    for part, fields in parts.items():
        own[part] = changed(own.get(part) or getattr(base, part), **fields)
    return changed(base, **own)


def _battery(old: BatteryReading, changes: dict[str, dict[str, Any]]) -> BatteryReading:
    values: dict[str, Measurement | None] = {}
    for name, change in changes.items():
        was = getattr(old, name) or _NONE
        value = change.get("value", was.value)
        values[name] = None if value is None else made(Measurement, value, change.get("t_s", was.t_s))
    return changed(old, **values)
