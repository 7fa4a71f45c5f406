"""Many snapshots of one bay as one record: of each value, the changes. Exact: every float comes back bit for bit.

Theory of operation. A charging bay is decided several times a second, mostly because values have become newer, not
different. So a record has columns instead of rows. A *number* (`charger.t_s`, `battery.soc_pct`) is a list with an
entry for each row: by how many thousandths it has grown, 0 if it is the same, or, where that would not be exact, the
number itself as a float; rows after the end of the list change nothing. Any other value is a list of pairs, row and
value. A column that equals an earlier one is that one's name.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from orchestrator.model import BatteryLink, BatteryReading, Cause, ChargerLink, ChargerReading, Snapshot
from orchestrator.model.cause import plain

Row = tuple[float, Snapshot]  #: the time of the decision, and what it was made from
#: The parts of a snapshot that are records, with a column for each of their fields.
RECORDS: Mapping[str, type[Any]] = {
    "charger": ChargerReading, "charger_link": ChargerLink, "battery_link": BatteryLink,
}  # fmt: skip
#: The other parts, but for the battery's reading: a column each.
OTHERS = tuple(one.name for one in fields(Snapshot) if one.name not in RECORDS and one.name != "battery")
#: The columns of a record's fields.
COLUMNS = {part: {one.name: f"{part}.{one.name}" for one in fields(kind)} for part, kind in RECORDS.items()}
BATTERY = {name: (f"battery.{name}", f"battery.{name}.t_s") for name in BatteryReading.__slots__}
#: Columns of numbers, beside the battery's.
NUMBERS = frozenset(
    column for columns in COLUMNS.values() for name, column in columns.items() if name.endswith(("_t_s", "sent_s"))
) | {"charger.t_s", "charger.voltage_v", "charger.current_a"}  # fmt: skip


def as_columns(base: Snapshot, rows: Sequence[Row]) -> dict[str, object]:
    """The record of `rows`, the first of which comes right after `base`, at the record's own time."""
    columns = Columns()
    at_s = rows[0][0]
    for number, (row_s, snapshot) in enumerate(rows):
        columns.row(number, base, snapshot)
        if number:
            columns.at.append(grown(at_s, row_s))
        base, at_s = snapshot, row_s
    return columns.record()


class Columns:
    """A record under construction."""

    def __init__(self) -> None:
        self.at: list[int | float] = []
        self._numbers: dict[str, list[int | float | None]] = {}
        self._values: dict[str, list[object]] = {}

    def row(self, number: int, old: Snapshot, new: Snapshot) -> None:
        """Add the differences between one snapshot and the next."""
        for part, columns in COLUMNS.items():
            was, now = getattr(old, part), getattr(new, part)
            if was is not now:
                self._record(number, part, columns, was, now)
        if new.battery is not old.battery:
            self._battery(number, old.battery, new.battery)
        for name in OTHERS:
            self._value(number, name, getattr(old, name), getattr(new, name))

    def record(self) -> dict[str, object]:
        """All columns."""
        found: dict[str, object] = {"at": self.at}
        seen: dict[str, str] = {}
        for name, entries in self._numbers.items():
            found[name] = alike = seen.setdefault(str(entries), name)
            if alike == name:
                found[name] = entries
        return {**found, **self._values}

    def _record(self, number: int, part: str, columns: Mapping[str, str], was: Any, now: Any) -> None:  # noqa: ANN401
        if was is None or now is None:
            self._value(number, part, was, now)
            for name, column in columns.items() if now is not None else ():
                if column in NUMBERS:  # what they grow from
                    self._number(number, column, None, getattr(now, name))
            return
        for name, column in columns.items():
            old, new = getattr(was, name), getattr(now, name)
            if column in NUMBERS:
                self._number(number, column, old, new)
            else:
                self._value(number, column, old, new)

    def _battery(self, number: int, was: BatteryReading, now: BatteryReading) -> None:
        for name, (value, time) in BATTERY.items():
            old, new = getattr(was, name), getattr(now, name)
            if old is new:
                continue
            self._number(number, value, old and old.value, new and new.value)
            if new is not None:
                self._number(number, time, old and old.t_s, new.t_s)

    def _value(self, number: int, column: str, old: object, new: object) -> None:
        if not same(old, new):
            self._values.setdefault(column, []).extend((number, bare(new)))

    def _number(self, number: int, column: str, old: float | None, new: float | None) -> None:
        if not same(old, new):
            entries = self._numbers.setdefault(column, [])
            entries.extend([0] * (number - len(entries)))
            entries.append(None if new is None else grown(old, new))


def same(old: object, new: object) -> bool:
    """Whether they are equal and written alike: 0.0 and -0.0, 1 and 1.0 are not."""
    if old is new:
        return True
    return old == new and old.__class__ is new.__class__ and (bool(old) or str(old) == str(new))


def grown(old: float | None, new: float) -> int | float:
    """What is written for a number after another: thousandths where both are whole ones."""
    before, after = thousandths(old), thousandths(new)
    return new if before is None or after is None or before == after else after - before


def thousandths(number: float | None) -> int | None:
    """The number in thousandths, if that is exact."""
    if number is None or not -1e12 < number < 1e12:
        return None
    whole = round(number * 1000)
    return whole if whole / 1000 == number and (whole or str(number) == "0.0") else None


def bare(value: object) -> object:
    """A value with the records and causes in it as JSON has them."""
    if isinstance(value, Cause):
        return plain(value)
    if isinstance(value, tuple):
        return [bare(one) for one in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: bare(getattr(value, one.name)) for one in fields(value)}
    return {name: bare(one) for name, one in value.items()} if isinstance(value, Mapping) else value
