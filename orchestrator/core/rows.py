"""Which row of each of a policy's tables is in force: the one that the value is in, or a gentler one that still holds.

A row that allows less is left only when the value is well inside the next one (`hysteresis`). If it keeps coming back
anyway, because less current changes the quantity itself, it stays for the rest of the charge. So nothing chatters at a
bound.
"""

from collections.abc import Mapping

from orchestrator.config.amperes import TableRule
from orchestrator.config.policy import Band
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Tables
from orchestrator.core.parts import changed
from orchestrator.core.rules import Spans

#: A row that has lowered the step more often than this in one charge is no longer left.
MOST_RETURNS = 2

Returns = tuple[tuple[str, int], ...]  #: how often each key has lowered the step in this charge
Values = Mapping[str, float | None]

NONE = Tables()


def values(f: Facts) -> dict[str, float | None]:
    """The values that the tables are about."""
    return {"temperature_c": f.temperature_c, "soc_pct": f.soc, "soh_pct": f.soh, "voltage_v": f.pack_v}


def update(f: Facts) -> Tables:
    """The rows in force by these facts."""
    memory, rules, before = f.memory, f.rules, f.memory.tables
    if f.battery_removed or f.battery.boots != memory.battery.boots:
        return before if before == NONE else NONE
    returns = before.row_returns if memory.session is not None else ()
    was, known = dict(before.rows), values(f)
    now = []
    for table in rules.tables:
        name = table.name
        found = _in_force(table, known[name], was.get(name), returns)
        if found is not None:
            now.append((name, found))
    for number, spans in enumerate(rules.where_spans):
        name = f"where[{number}]"
        if _holds(name, spans, known, returns, was=name in was):
            now.append((name, number))
    rows = tuple(now)
    if rows == before.rows and returns == before.row_returns:
        return before
    return changed(before, rows=rows, row_returns=returns)


def _in_force(table: TableRule, value: float | None, was: int | None, returns: Returns) -> int | None:
    """The row of one table; None outside it. An unknown value changes nothing."""
    rows, amps = table.rows, table.amps
    if value is None or (was is not None and was < len(rows) and rows[was].from_ <= value < rows[was].to):
        return was
    now = _row(rows, value)
    if now is None or was is None or was >= len(rows) or amps[was] >= amps[now]:
        return now
    near = rows[was].from_ - table.inside < value < rows[was].to + table.inside
    return was if near or _stays(f"current.{table.name}.rows[{was}]", returns) else now


def _holds(name: str, spans: Spans, known: Values, returns: Returns, *, was: bool) -> bool:
    """Whether a rule of `where` holds; unknown values count as inside."""
    for quantity, span, inside in spans:
        value, wider = known[quantity], inside if was else 0.0
        if value is not None and not span.low - wider <= value <= span.high + wider:
            return was and _stays(f"current.{name}", returns)
    return True


def _stays(key: str, returns: Returns) -> bool:
    """Whether it came back too often. Only steps down count: a pause may recur, or it would last for ever."""
    return dict(returns).get(key, 0) > MOST_RETURNS


def lowered(tables: Tables, key: str) -> Tables:
    """The rule with this key has lowered the step once more."""
    times = dict(tables.row_returns)
    return changed(tables, row_returns=tuple((times | {key: times.get(key, 0) + 1}).items()))


def _row(rows: tuple[Band, ...], value: float) -> int | None:
    """The index of the row that `value` is in; the last row includes its end."""
    for index, band in enumerate(rows):
        if band.from_ <= value < band.to:
            return index
    return len(rows) - 1 if value == rows[-1].to else None
