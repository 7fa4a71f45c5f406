"""Which row of each of a policy's tables is in force: the one that the value is in, or a gentler one that holds on.

A row that allows less is left only when the value is well inside the next one (`hysteresis`). One that comes back again
and again all the same, because less current changes what it is about, stays for the rest of the charge. So nothing
chatters at a bound.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from orchestrator.config.amperes import TableRule, hysteresis, ranges
from orchestrator.config.policy import Band, Where
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Tables
from orchestrator.core.parts import changed

#: A row that has brought the step down more often than this in one charge is not left any more.
MOST_RETURNS = 2

NONE = Tables()


def values(f: Facts) -> dict[str, float | None]:
    """What the tables are about."""
    return {"temperature_c": f.temperature_c, "soc_pct": f.soc, "soh_pct": f.soh, "voltage_v": f.pack_v}


@dataclass(frozen=True, slots=True)
class _Follower:
    """Works out the rows of one step."""

    f: Facts
    before: Mapping[str, int]
    returns: Mapping[str, int]

    def table(self, table: TableRule, value: float | None) -> int | None:
        """The row of one table; None outside of it. A value that is not known changes nothing."""
        was, rows, amps = self.before.get(table.name), table.rows, table.amps
        if value is None:
            return was
        now = _row(rows, value)
        if now is None or was is None or was >= len(rows) or amps[was] >= amps[now]:
            return now
        near = rows[was].from_ - table.inside < value < rows[was].to + table.inside
        return was if near or self._stays(f"current.{table.name}.rows[{was}]") else now

    def rule(self, number: int, rule: Where, known: Mapping[str, float | None]) -> bool:
        """Whether a rule of `where` holds; what is not known is taken to be inside."""
        name = f"where[{number}]"
        was = name in self.before
        for quantity, span in ranges(rule).items():
            value = known[quantity]
            wider = hysteresis(self.f.rules.policy.current, quantity) if was else 0.0
            if value is not None and not span.low - wider <= value <= span.high + wider:
                return was and self._stays(f"current.{name}")
        return True

    def _stays(self, key: str) -> bool:
        """Whether it came back too often. A pause is no step, and may come again: it would else be for ever."""
        return self.returns.get(key, 0) > MOST_RETURNS


def update(f: Facts) -> Tables:
    """The rows that are in force by these facts."""
    memory, current = f.memory, f.rules.policy.current
    before = memory.tables
    if f.departed or f.battery.boots != memory.battery.boots:
        return before if before == NONE else NONE
    returns = before.row_returns if memory.session is not None else ()
    follower, known = _Follower(f, dict(before.rows), dict(returns)), values(f)
    now: dict[str, int] = {}
    for table in f.rules.tables:
        if (found := follower.table(table, known[table.name])) is not None:
            now[table.name] = found
    for number, rule in enumerate(current.where):
        if follower.rule(number, rule, known):
            now[f"where[{number}]"] = number
    rows = tuple(now.items())
    if rows == before.rows and returns == before.row_returns:
        return before
    return changed(before, rows=rows, row_returns=returns)


def lowered(tables: Tables, key: str) -> Tables:
    """What this key names has brought the step down once more."""
    times = dict(tables.row_returns)
    return changed(tables, row_returns=tuple((times | {key: times.get(key, 0) + 1}).items()))


def _row(rows: tuple[Band, ...], value: float) -> int | None:
    """The index of the row that `value` lies in; the last one includes its end."""
    for index, band in enumerate(rows):
        if band.from_ <= value < band.to:
            return index
    return len(rows) - 1 if value == rows[-1].to else None
