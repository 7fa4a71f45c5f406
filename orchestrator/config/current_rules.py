"""Checks of the tables and rules in one policy's `current`."""

import re
from collections.abc import Iterator, Mapping

from orchestrator.config.amperes import ranges
from orchestrator.config.policy import Band, Where
from orchestrator.config.rules import Problems, Rule
from orchestrator.keys import Range

Rows = tuple[Band, ...]


def table_problems(at: str, rows: Rows, low: float, high: float, unit: str) -> Problems:
    """Rows must be in order, each beginning where the previous one ends, from `low` or less to `high` or more."""
    for i, row in enumerate(rows):
        if row.from_ >= row.to:
            yield f"{at}[{i}]", f"from {row.from_:g} to {row.to:g} is empty: `from` must be below `to`"
        if i and row.from_ != (end := rows[i - 1].to):
            what = "leaves a gap" if row.from_ > end else "overlaps the row above or is out of order"
            yield (
                f"{at}[{i}].from",
                f"{row.from_:g} {what}: the row above ends at {end:g} {unit}, so this one begins there",
            )
    if rows[0].from_ > low:
        yield f"{at}[0].from", f"the table begins at {rows[0].from_:g} {unit}; it must begin at {low:g} or below"
    if rows[-1].to < high:
        yield (
            f"{at}[{len(rows) - 1}].to",
            f"the table ends at {rows[-1].to:g} {unit}; it must reach {high:g} or beyond",
        )


def _table(name: str, unit: str, must_cover: str) -> Rule:
    at = f"current.{name}.rows"

    def test(rows: Rows, cover: Range | float) -> Problems:
        low, high = (cover.low, cover.high) if isinstance(cover, Range) else (cover, 100.0)
        yield from table_problems(at, rows, low, high, unit)

    return Rule(test, (at, must_cover))


def _soc_table(rows: Rows) -> Problems:
    yield from table_problems("current.soc_pct.rows", rows, 0.0, 100.0, "%")


CURRENT_RULES: tuple[Rule, ...] = (
    _table("temperature_c", "°C", "pack.temperature_c"),
    Rule(_soc_table, ("current.soc_pct.rows",)),
    _table("soh_pct", "%", "pack.soh_min_pct"),
    _table("voltage_v", "V", "pack.voltage_v"),
)

_ROW = re.compile(r"current\.(?:\w+\.rows|where)\[\d+\]")


def amperes_problems(values: Mapping[str, object]) -> Problems:
    """Each row's amperes must be given once, with a capacity if needed, and must not exceed the pack's current."""
    current_a, capacity_ah = values.get("pack.current_a"), values.get("pack.capacity_ah")
    for at, row in values.items():
        if not _ROW.fullmatch(at) or not isinstance(row, Band | Where):
            continue
        yield from _where(at, row)
        if row.max_a is not None and row.max_c is not None:
            yield f"{at}.max_c", "write max_a or max_c, not both"
        elif row.max_c is not None and capacity_ah is None and "pack.capacity_ah" in values:
            yield f"{at}.max_c", "needs pack.capacity_ah, the rated capacity; or write max_a"
        elif isinstance(current_a, float):
            yield from _too_much(at, row, current_a, capacity_ah if isinstance(capacity_ah, float) else None)


def _too_much(at: str, row: Band | Where, current_a: float, capacity_ah: float | None) -> Problems:
    """No row may exceed the pack's data sheet."""
    for key, amps in _said(row, capacity_ah):
        if round(amps, 6) > current_a:
            yield f"{at}.{key}", f"{amps:g} A is above pack.current_a, {current_a:g} A, the most that the pack bears"


def _said(row: Band | Where, capacity_ah: float | None) -> Iterator[tuple[str, float]]:
    if row.max_a is not None:
        yield "max_a", row.max_a
    if row.max_c is not None and capacity_ah is not None:
        yield "max_c", row.max_c * capacity_ah


def _where(at: str, row: Band | Where) -> Problems:
    if not isinstance(row, Where):
        return
    if len(ranges(row)) < 2:
        yield at, "name at least two of temperature_c, soc_pct, soh_pct, voltage_v; a rule on one stands in its table"
    if row.max_a is None and row.max_c is None:
        yield at, "write max_a or max_c: without one this rule limits nothing"
