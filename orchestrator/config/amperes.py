"""Resolves a policy's C rates and omitted keys into amperes, volts, hours and ampere-hours. Pure."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from orchestrator.config.policy import Band, CellType, Current, Finish, Needs, Pack, Policy, Table, Thresholds, Where
from orchestrator.keys import Range

#: The smallest difference between two readings: the resolution of the BMU's words (shipped object maps), with its unit.
RESOLUTION = {"temperature_c": (0.1, "°C"), "soc_pct": (1.0, "%"), "soh_pct": (1.0, "%"), "voltage_v": (0.01, "V")}
#: The default hysteresis: how far inside the next row a value must be.
HYSTERESIS = {name: 2 * least for name, (least, _) in RESOLUTION.items()}
#: Computed amperes are compared after rounding to this many digits: 0.7 C of 20 Ah is 14 A.
DIGITS = 6
#: A taper counts only above this share of the end voltage.
END_SHARE = 0.97
#: By default, the current has tapered off below this share of the capacity.
TAPER_C = 0.05
#: The default difference allowed between charger and BMU: cable, resolution, offset.
DIFFER_V, DIFFER_PCT = 1.0, 2.0
#: The factors by which a charge may exceed the time, and the charge, that the rated capacity needs.
LONGER, MORE = 1.5, 1.1


@dataclass(frozen=True, slots=True)
class CellVolts:
    """A chemistry's cell limits: full voltage, plausible range of a policy's top voltage, coldest charge."""

    end_v: float
    least_v: float  #: a top voltage below this does not fit the chemistry
    most_v: float  #: … nor does one above this
    coldest_c: float


#: From data sheets. Below 0 °C lithium plates on graphite at any current; titanate has no such limit.
CELL_VOLTS: Mapping[CellType, CellVolts] = {
    CellType.NMC: CellVolts(4.20, 3.90, 4.40, 0.0),
    CellType.NCA: CellVolts(4.20, 3.90, 4.30, 0.0),
    CellType.LFP: CellVolts(3.55, 3.40, 3.80, 0.0),
    CellType.LTO: CellVolts(2.70, 2.50, 2.95, -30.0),
}


@dataclass(frozen=True, slots=True)
class TaperRule:
    """A taper with its defaults filled in."""

    below_a: float
    above_v: float
    for_s: float


def row_a(row: Band | Where, current_a: float, capacity_ah: float | None) -> float:
    """The most that a row allows; by default the pack's own current."""
    said = [current_a]
    if row.max_a is not None:
        said.append(row.max_a)
    if row.max_c is not None:
        said.append(row.max_c * capacity_ah if capacity_ah is not None else 0.0)
    return round(min(said), DIGITS)


def tables(current: Current) -> Iterator[tuple[str, Table]]:
    """The policy's tables, by quantity."""
    for name in RESOLUTION:
        table: Table | None = getattr(current, name)
        if table is not None:
            yield name, table


@dataclass(frozen=True, slots=True)
class TableRule:
    """A table with its defaults filled in."""

    name: str
    rows: tuple[Band, ...]
    amps: tuple[float, ...]  #: what each row allows
    inside: float  #: its hysteresis


def table_rules(policy: Policy) -> tuple[TableRule, ...]:
    """The policy's tables."""
    pack, current = policy.pack, policy.current
    return tuple(
        TableRule(
            name,
            table.rows,
            tuple(row_a(row, pack.current_a, pack.capacity_ah) for row in table.rows),
            hysteresis(current, name),
        )
        for name, table in tables(current)
    )


def where_a(policy: Policy) -> tuple[float, ...]:
    """The current that each rule of `where` allows."""
    return tuple(row_a(rule, policy.pack.current_a, policy.pack.capacity_ah) for rule in policy.current.where)


def hysteresis(current: Current, name: str) -> float:
    """How far inside the next row a value must be before the current rises."""
    table: Table | None = getattr(current, name)
    said = table.hysteresis if table is not None else None
    return HYSTERESIS[name] if said is None else said


def ranges(rule: Where) -> dict[str, Range]:
    """The quantities that a rule restricts."""
    return {name: value for name in RESOLUTION if (value := getattr(rule, name)) is not None}


def highest_step(allowed_a: float, worst_a: tuple[float, ...]) -> int | None:
    """The highest step whose worst case does not exceed the allowed current; None if even the lowest step does."""
    for index in range(len(worst_a) - 1, -1, -1):
        if round(worst_a[index], DIGITS) <= allowed_a:
            return index
    return None


def end_v(pack: Pack) -> float:
    """The voltage of a full pack at rest: the chemistry's, or the pack's limit if that is lower."""
    return min(CELL_VOLTS[pack.chemistry].end_v * pack.cells_in_series, pack.voltage_v.high)


def taper_of(policy: Policy) -> TaperRule | None:
    """The taper that ends a charge; None if there is none."""
    pack, full = policy.pack, policy.finish.full
    taper = full.taper
    if taper is None:  # the default taper ends a charge, but is never required
        if pack.capacity_ah is None or full.needs is Needs.ALL:
            return None
        return TaperRule(TAPER_C * pack.capacity_ah, END_SHARE * end_v(pack), 120.0)
    below_a = taper.below_a
    if below_a is None:
        below_a = (TAPER_C if taper.below_c is None else taper.below_c) * (pack.capacity_ah or 0.0)
    return TaperRule(below_a, END_SHARE * end_v(pack) if taper.above_v is None else taper.above_v, taper.for_s)


def volts_differ(faults: Thresholds, pack_v: float) -> float:
    """How much charger and BMU may differ: the stricter of the policy's values, else the larger of the defaults."""
    said = [faults.volts_differ_v] if faults.volts_differ_v is not None else []
    if faults.volts_differ_pct is not None:
        said.append(faults.volts_differ_pct / 100 * pack_v)
    return min(said, default=max(DIFFER_V, DIFFER_PCT / 100 * pack_v))


def max_ah(pack: Pack, finish: Finish) -> float:
    """The most charge that a battery may take."""
    return finish.max_ah if finish.max_ah is not None else MORE * (pack.capacity_ah or 0.0)


def lowest_a(policy: Policy) -> float:
    """The lowest current above zero that the rows allow."""
    pack, current = policy.pack, policy.current
    rows: list[Band | Where] = [*current.where, *(row for _, table in tables(current) for row in table.rows)]
    amps = [row_a(row, pack.current_a, pack.capacity_ah) for row in rows]
    return min((a for a in amps if a > 0), default=pack.current_a)


def max_hours(policy: Policy, worst_a: tuple[float, ...]) -> float:
    """How long a charge may take on a charger with these steps."""
    finish, capacity_ah = policy.finish, policy.pack.capacity_ah
    if finish.max_hours is not None:
        return finish.max_hours
    step = highest_step(lowest_a(policy), worst_a)
    return LONGER * (capacity_ah or 0.0) / worst_a[step or 0] + finish.hold_min / 60
