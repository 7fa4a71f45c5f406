"""What must hold between the keys of one policy."""

from orchestrator.config.names import name_problem
from orchestrator.config.policy import Table
from orchestrator.config.rules import Problems, Rule
from orchestrator.keys import Range

CELL_V = Range(2.0, 4.35)  #: no lithium cell is charged outside: below, copper dissolves; above is beyond LiHV
PRECHARGE_MAX_MIN = 30.0  #: both stages together, FAULTS C15


def _name(name: str) -> Problems:
    if problem := name_problem(name):
        yield "policy", problem


def _cells(cells: int, voltage_v: Range) -> Problems:
    for i, volts in enumerate((voltage_v.low, voltage_v.high)):
        if round(volts / cells, 3) not in CELL_V:
            yield (
                f"pack.voltage_v[{i}]",
                f"{volts:g} V on {cells} cells in series is {volts / cells:.2f} V a cell; "
                f"allowed: {CELL_V} V a cell, here {cells * CELL_V.low:g} … {cells * CELL_V.high:g} V",
            )


def _inside_pack(at: str) -> Rule:
    def test(volts: float, voltage_v: Range) -> Problems:
        if volts not in voltage_v:
            yield at, f"{volts:g} V is outside pack.voltage_v, {voltage_v} V"

    return Rule(test, (at, "pack.voltage_v"))


def _pulse(until_v: float, below_v: float) -> Problems:
    if until_v > below_v:
        yield (
            "precharge.pulse.until_v",
            f"{until_v:g} V is above precharge.below_v, {below_v:g} V: precharge would be over already",
        )


def _precharge_time(pulse_min: float, continuous_min: float) -> Problems:
    if pulse_min + continuous_min > PRECHARGE_MAX_MIN:
        yield (
            "precharge.continuous.max_min",
            f"with the pulse stage this is {pulse_min + continuous_min:g} min; "
            f"at most {PRECHARGE_MAX_MIN:g} min together, here {PRECHARGE_MAX_MIN - pulse_min:g} min",
        )


def _rise(within_min: float, pulse_min: float, continuous_min: float) -> Problems:
    if within_min > pulse_min + continuous_min:
        yield (
            "precharge.rise.within_min",
            f"{within_min:g} min is longer than the whole precharge, {pulse_min + continuous_min:g} min: "
            "the rise would never be looked at",
        )


def _start(start_pct: float, finish_pct: float) -> Problems:
    if start_pct > finish_pct:
        yield (
            "start.soc_below_pct",
            f"{start_pct:g} % is above finish.soc_pct, {finish_pct:g} %: a charge would be over when it begins",
        )


def _recharge(recharge_pct: float, finish_pct: float) -> Problems:
    if recharge_pct >= finish_pct:
        yield (
            "recharge.soc_below_pct",
            f"{recharge_pct:g} % must be below finish.soc_pct, {finish_pct:g} %: else a full battery is charged again",
        )


def _trip(trip_c: float, temperature_c: Range) -> Problems:
    if trip_c <= temperature_c.high:
        yield (
            "pack.temperature_c[1]",
            f"{temperature_c.high:g} °C must be below faults.temperature_trip_c, {trip_c:g} °C: "
            "at the one the bay pauses, at the other it latches",
        )


def table_problems(at: str, table: Table, low: float, high: float, unit: str) -> Problems:
    """Rows in order, each beginning where the one before ends, from `low` or less to `high` or more."""
    for i, row in enumerate(table):
        if row.from_ >= row.to:
            yield f"{at}[{i}]", f"from {row.from_:g} to {row.to:g} is empty: `from` must be below `to`"
        if i and row.from_ != (end := table[i - 1].to):
            what = "leaves a gap" if row.from_ > end else "overlaps the row above or is out of order"
            yield (
                f"{at}[{i}].from",
                f"{row.from_:g} {what}: the row above ends at {end:g} {unit}, so this one begins there",
            )
    if table[0].from_ > low:
        yield f"{at}[0].from", f"the table begins at {table[0].from_:g} {unit}; it must begin at {low:g} or below"
    if table[-1].to < high:
        yield (
            f"{at}[{len(table) - 1}].to",
            f"the table ends at {table[-1].to:g} {unit}; it must reach {high:g} or beyond",
        )


def _table(at: str, unit: str, must_cover: str) -> Rule:
    def test(table: Table, cover: Range | float) -> Problems:
        low, high = (cover.low, cover.high) if isinstance(cover, Range) else (cover, 100.0)
        yield from table_problems(at, table, low, high, unit)

    return Rule(test, (at, must_cover))


def _soc_table(table: Table) -> Problems:
    yield from table_problems("current.soc_pct", table, 0.0, 100.0, "%")


POLICY_RULES: tuple[Rule, ...] = (
    Rule(_name, ("policy",)),
    Rule(_cells, ("pack.cells_in_series", "pack.voltage_v")),
    _inside_pack("precharge.below_v"),
    _inside_pack("precharge.pulse.until_v"),
    _inside_pack("finish.taper.above_v"),
    Rule(_pulse, ("precharge.pulse.until_v", "precharge.below_v")),
    Rule(_precharge_time, ("precharge.pulse.max_min", "precharge.continuous.max_min")),
    Rule(_rise, ("precharge.rise.within_min", "precharge.pulse.max_min", "precharge.continuous.max_min")),
    Rule(_start, ("start.soc_below_pct", "finish.soc_pct")),
    Rule(_recharge, ("recharge.soc_below_pct", "finish.soc_pct")),
    Rule(_trip, ("faults.temperature_trip_c", "pack.temperature_c")),
    _table("current.temperature_c", "°C", "pack.temperature_c"),
    Rule(_soc_table, ("current.soc_pct",)),
    _table("current.soh_pct", "%", "pack.soh_min_pct"),
    _table("current.voltage_v", "V", "pack.voltage_v"),
)
