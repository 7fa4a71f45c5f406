"""Warnings about policy entries that are valid but probably unintended, each at its key, for `orchestrator check`.

The rules here look at what the core does with the keys: rows that no value can reach, amperes that another table never
allows, an end that cannot come. Invalid entries are refused by the rules in `config`.
"""

from collections.abc import Mapping

from orchestrator.config.amperes import CELL_VOLTS, RESOLUTION, row_a
from orchestrator.config.policy import Band, CellType
from orchestrator.config.rules import Problems, Rule, problems
from orchestrator.core.cells import CHEMISTRIES, EMPTY_PCT
from orchestrator.core.checks.battery import HEAT_HYSTERESIS_K
from orchestrator.core.resting import RECHARGE_DROP_PCT
from orchestrator.keys import Range, Source
from orchestrator.workbench.baylint import bay_lint
from orchestrator.workbench.disklint import disk_lint
from orchestrator.workbench.prove.physics import physics_lint
from orchestrator.workbench.supplylint import supply_lint
from orchestrator.workbench.wiringlint import wiring_lint

Rows = tuple[Band, ...]


def _precharge(below_v: float, voltage_v: Range) -> Problems:
    if below_v <= voltage_v.low:
        yield "precharge.below_v", f"precharge never begins: a pack below {voltage_v.low:g} V is refused before it"


def _pulse(until_v: float, voltage_v: Range) -> Problems:
    if until_v <= voltage_v.low:
        text = f"the pulse stage ends as it begins: every pack that is not refused has {voltage_v.low:g} V or more"
        yield "precharge.pulse.until_v", text


def _taper(above_v: float, voltage_v: Range) -> Problems:
    if above_v >= voltage_v.high:
        yield "finish.full.taper.above_v", f"the taper is never seen: above {voltage_v.high:g} V the bay has stopped"


def _window(allowed: Range) -> Problems:
    """The window between the limits must be wider than the pauses' hysteresis."""
    again_c = allowed.high - HEAT_HYSTERESIS_K
    if again_c <= allowed.low:
        text = f"too narrow: after a pause for heat it charges again below {again_c:g} °C, where it pauses for cold"
        yield "pack.temperature_c", text


def _end(values: Mapping[str, object]) -> Problems:
    """Without a second sign of full, a BMU that stays at 99 % runs into the time limit, which latches."""
    full = "finish.full"
    taper = values.get(f"{full}.taper") or (values.get("pack.capacity_ah") and values.get(f"{full}.needs") == "any")
    if values.get("finish.target_soc_pct") == 100 and not taper and values.get(f"{full}.charger") is False:
        yield full, "only the BMU's own 100 % ends a charge; at 99 % it goes on to max_hours, and latches"


def _chemistry(kind: CellType, cells: int, voltage_v: Range) -> Problems:
    """A voltage too low for the chemistry: allowed, because it errs on the gentle side."""
    least_v = CELL_VOLTS[kind].least_v
    if voltage_v.high < least_v * cells:
        text = f"{voltage_v.high / cells:.2f} V a cell are few for {kind} ({least_v:g} V or more): is it another one?"
        yield "pack.chemistry", text


def _awake(below_v: float, kind: CellType, cells: int) -> Problems:
    """Voltage, chemistry and SOC go together: a pack that is precharged must be empty."""
    empty_v = CHEMISTRIES[kind].ocv_v(EMPTY_PCT)
    if below_v > round(empty_v * cells, 2):
        yield (
            "precharge.below_v",
            f"{below_v / cells:.2f} V a cell is no deep discharge: {kind} has {empty_v:.2f} V at SOC {EMPTY_PCT:g} %",
        )


def _refuses(voltage_v: Range, kind: CellType, cells: int) -> Problems:
    empty_v = CHEMISTRIES[kind].ocv_v(EMPTY_PCT)
    if voltage_v.low > round(empty_v * cells, 2):
        yield (
            "pack.voltage_v[0]",
            f"{voltage_v.low / cells:.2f} V a cell refuses packs that are not empty: {kind} has {empty_v:.2f} V at SOC "
            f"{EMPTY_PCT:g} %",
        )


def _differ(volts: float, share_pct: float, voltage_v: Range) -> Problems:
    """Two thresholds on one quantity, of which one never takes effect."""
    low_v, high_v = (share_pct / 100 * end_v for end_v in (voltage_v.low, voltage_v.high))
    if volts <= low_v:
        yield "faults.volts_differ_pct", f"never in force: {volts:g} V is stricter than {share_pct:g} % everywhere"
    elif volts >= high_v:
        yield "faults.volts_differ_v", f"never in force: {share_pct:g} % is stricter than {volts:g} V everywhere"


def _recharge(recharge_pct: float, target_pct: float) -> Problems:
    most = target_pct - RECHARGE_DROP_PCT
    if recharge_pct > most:
        text = f"too near to full: the SOC must have fallen by {RECHARGE_DROP_PCT:g} % first, so {most:g} % is in force"
        yield "recharge.soc_below_pct", text


def _rows(name: str, rows: Rows, low: float, high: float, why: str) -> Problems:
    """Rows that no value can reach: only `low` … `high` can occur."""
    for number, row in enumerate(rows):
        if row.to <= low or row.from_ >= high:
            yield f"current.{name}.rows[{number}]", f"this row is never used: {why}"


def _temperatures(rows: Rows, allowed: Range) -> Problems:
    yield from _rows("temperature_c", rows, allowed.low, allowed.high, f"charging pauses outside {allowed} °C")


def _charges(rows: Rows, target_pct: float) -> Problems:
    yield from _rows("soc_pct", rows, 0, target_pct, f"the charge is over at {target_pct:g} %")


def _healths(rows: Rows, least_pct: float) -> Problems:
    yield from _rows("soh_pct", rows, least_pct, 100, f"a pack below {least_pct:g} % is refused")


def _voltages(rows: Rows, allowed: Range) -> Problems:
    yield from _rows("voltage_v", rows, allowed.low, allowed.high, f"no current flows outside {allowed} V")


def _tables(values: Mapping[str, object]) -> Problems:
    """Rows so narrow that the step will flap, and amperes that another table never allows."""
    current_a, capacity_ah = values.get("pack.current_a"), values.get("pack.capacity_ah")
    if not isinstance(current_a, float):
        return
    amps = {
        name: [row_a(row, current_a, capacity_ah if isinstance(capacity_ah, float) else None) for row in rows]
        for name in RESOLUTION if isinstance(rows := values.get(f"current.{name}.rows"), tuple)
    }  # fmt: skip
    for name, allowed in amps.items():
        rows, (resolution, unit) = values[f"current.{name}.rows"], RESOLUTION[name]
        others = {other: max(each) for other, each in amps.items() if other != name}
        least = min(others, key=others.__getitem__, default="")
        for number, row in enumerate(rows if isinstance(rows, tuple) else ()):
            at = f"current.{name}.rows[{number}]"
            if round(row.to - row.from_, 6) <= resolution:
                yield at, f"as narrow as the BMU's resolution, {resolution:g} {unit}: the step will flap"
            if least and others[least] < allowed[number] and (row.max_a, row.max_c) != (None, None):
                text = (
                    f"{allowed[number]:g} A never flow: current.{least} allows at most {others[least]:g} A everywhere"
                )
                yield at, text


_RULES = (
    Rule(_precharge, ("precharge.below_v", "pack.voltage_v")),
    Rule(_pulse, ("precharge.pulse.until_v", "pack.voltage_v")),
    Rule(_window, ("pack.temperature_c",)),
    Rule(_chemistry, ("pack.chemistry", "pack.cells_in_series", "pack.voltage_v")),
    Rule(_taper, ("finish.full.taper.above_v", "pack.voltage_v")),
    Rule(_awake, ("precharge.below_v", "pack.chemistry", "pack.cells_in_series")),
    Rule(_refuses, ("pack.voltage_v", "pack.chemistry", "pack.cells_in_series")),
    Rule(_differ, ("faults.volts_differ_v", "faults.volts_differ_pct", "pack.voltage_v")),
    Rule(_recharge, ("recharge.soc_below_pct", "finish.target_soc_pct")),
    Rule(_temperatures, ("current.temperature_c.rows", "pack.temperature_c")),
    Rule(_healths, ("current.soh_pct.rows", "pack.soh_min_pct")),
    Rule(_voltages, ("current.voltage_v.rows", "pack.voltage_v")),
)


def policy_lint(values: Mapping[str, object], _written: Source) -> Problems:
    """Probably unintended entries of a policy, by the paths of its keys."""
    yield from problems(_RULES, values)
    target_pct, rows = values.get("finish.target_soc_pct"), values.get("current.soc_pct.rows")
    if isinstance(target_pct, float) and isinstance(rows, tuple) and values.get("finish.full_every_days") is None:
        yield from _charges(rows, target_pct)
    yield from _end(values)
    yield from _tables(values)
    yield from physics_lint(values)


def station_lint(values: Mapping[str, object], written: Source) -> Problems:
    """Probably unintended entries of a station: policies at its chargers, wiring, supplies, places on the disk."""
    for lint in (bay_lint, wiring_lint, supply_lint, disk_lint):
        yield from lint(values, written)


LINT = {"policy": policy_lint, "station": station_lint}
