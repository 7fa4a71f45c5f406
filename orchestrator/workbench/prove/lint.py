"""What is allowed in a policy and can hardly be meant: warnings, each at its key, for `orchestrator check`.

A rule here looks at what the core does with the keys: rows that no value can reach, steps that another table never
allows, an end that cannot come. What cannot be at all, the rules of `config` refuse.
"""

from collections.abc import Iterator, Mapping
from typing import cast

from orchestrator.config.policy import Policy, Table
from orchestrator.config.rules import Problems, Rule, problems
from orchestrator.core.checks.battery import HEAT_HYSTERESIS_K
from orchestrator.core.course import RECHARGE_DROP_PCT
from orchestrator.keys import Range
from orchestrator.model import ControlMode

#: The least that two readings can differ by: what the BMU's words carry (the shipped object maps).
RESOLUTION = {"temperature_c": (0.1, "°C"), "soc_pct": (1.0, "%"), "soh_pct": (1.0, "%"), "voltage_v": (0.01, "V")}
#: A pack's capacity is about this much less than what a charge may take at most (`finish.max_ah`, by its own advice).
MARGIN = 1.1


def _precharge(below_v: float, voltage_v: Range) -> Problems:
    if below_v <= voltage_v.low:
        yield "precharge.below_v", f"precharge never begins: a pack below {voltage_v.low:g} V is refused before it"


def _pulse(until_v: float, voltage_v: Range) -> Problems:
    if until_v <= voltage_v.low:
        text = f"the pulse stage ends as it begins: every pack that is not refused has {voltage_v.low:g} V or more"
        yield "precharge.pulse.until_v", text


def _taper(above_v: float, voltage_v: Range) -> Problems:
    if above_v >= voltage_v.high:
        yield "finish.taper.above_v", f"the taper is never seen: above {voltage_v.high:g} V the bay has stopped"


def _window(allowed: Range) -> Problems:
    """Between the limits there must be room for the hysteresis of the pauses."""
    again_c = allowed.high - HEAT_HYSTERESIS_K
    if again_c <= allowed.low:
        text = f"too narrow: after a pause for heat it charges again below {again_c:g} °C, where it pauses for cold"
        yield "pack.temperature_c", text


def _end(values: Mapping[str, object]) -> Problems:
    """Without a second way to be full, a BMU that stays at 99 % leads into the time limit, which latches."""
    ways = values.get("finish.taper"), values.get("finish.charger_full")
    if values.get("finish.soc_pct") == 100 and not any(ways):
        yield "finish.soc_pct", "only the BMU's own 100 % ends a charge; at 99 % it goes on to max_hours, and latches"


def _recharge(recharge_pct: float, finish_pct: float) -> Problems:
    most = finish_pct - RECHARGE_DROP_PCT
    if recharge_pct > most:
        text = f"too near to full: the SOC must have fallen by {RECHARGE_DROP_PCT:g} % first, so {most:g} % is in force"
        yield "recharge.soc_below_pct", text


def _rows(name: str, table: Table, low: float, high: float, why: str) -> Problems:
    """Rows of which no value can come up: only `low` … `high` can."""
    for number, row in enumerate(table):
        if row.to <= low or row.from_ >= high:
            yield f"current.{name}[{number}]", f"this row is never used: {why}"


def _temperatures(table: Table, allowed: Range) -> Problems:
    yield from _rows("temperature_c", table, allowed.low, allowed.high, f"charging pauses outside {allowed} °C")


def _charges(table: Table, finish_pct: float) -> Problems:
    yield from _rows("soc_pct", table, 0, finish_pct, f"the charge is over at {finish_pct:g} %")


def _healths(table: Table, least_pct: float) -> Problems:
    yield from _rows("soh_pct", table, least_pct, 100, f"a pack below {least_pct:g} % is refused")


def _voltages(table: Table, allowed: Range) -> Problems:
    yield from _rows("voltage_v", table, allowed.low, allowed.high, f"no current flows outside {allowed} V")


def _tables(values: Mapping[str, object]) -> Problems:
    """Rows that are too narrow to be hit for long, and steps that another table never allows."""
    tables = {name: cast("Table", values[f"current.{name}"]) for name in RESOLUTION if values.get(f"current.{name}")}
    most = {name: max(row.step for row in table) for name, table in tables.items()}
    for name, table in tables.items():
        resolution, unit = RESOLUTION[name]
        others = {other: step for other, step in most.items() if other != name}
        lowest = min(others, key=others.__getitem__, default="")
        for number, row in enumerate(table):
            if round(row.to - row.from_, 6) <= resolution:
                text = f"as narrow as the BMU's resolution, {resolution:g} {unit}: the step will flap"
                yield f"current.{name}[{number}]", text
            if lowest and others[lowest] < row.step < max(most.values()):
                text = f"step {row.step} is never taken: current.{lowest} allows at most {others[lowest]} everywhere"
                yield f"current.{name}[{number}].step", text


_RULES = (
    Rule(_precharge, ("precharge.below_v", "pack.voltage_v")),
    Rule(_pulse, ("precharge.pulse.until_v", "pack.voltage_v")),
    Rule(_window, ("pack.temperature_c",)),
    Rule(_taper, ("finish.taper.above_v", "pack.voltage_v")),
    Rule(_recharge, ("recharge.soc_below_pct", "finish.soc_pct")),
    Rule(_temperatures, ("current.temperature_c", "pack.temperature_c")),
    Rule(_charges, ("current.soc_pct", "finish.soc_pct")),
    Rule(_healths, ("current.soh_pct", "pack.soh_min_pct")),
    Rule(_voltages, ("current.voltage_v", "pack.voltage_v")),
)


def policy_lint(values: Mapping[str, object]) -> Problems:
    """What a policy can hardly mean, by the paths of its keys."""
    yield from problems(_RULES, values)
    yield from _end(values)
    yield from _tables(values)


# --- a policy at its bay ---------------------------------------------------------------------------------------------


def station_lint(values: Mapping[str, object]) -> Problems:
    """What a policy can hardly mean at the bay that names it: its steps are the charger's."""
    for path, policy in values.items():
        bay = path.removesuffix(".policy")
        if not isinstance(policy, Policy) or values.get(f"{bay}.charger.control") is not ControlMode.MANUAL:
            continue
        steps_a, limit_a = values.get(f"{bay}.charger.steps_a"), values.get(f"{bay}.limits.current_a")
        if isinstance(steps_a, tuple) and isinstance(limit_a, float):
            yield from ((path, text) for text in _at_bay(policy, [amps for amps in steps_a if amps <= limit_a]))


def _at_bay(policy: Policy, steps_a: list[float]) -> Iterator[str]:
    """`steps_a` are the steps that the station allows, lowest first."""
    current, finish, source = policy.current, policy.finish, policy.source
    tables = [table for table in (current.temperature_c, current.soc_pct, current.soh_pct, current.voltage_v) if table]
    best = min(len(steps_a) - 1, *(max(row.step for row in table) for table in tables))
    if best < 0:
        return
    hours = finish.max_ah / MARGIN / steps_a[best]
    if hours > finish.max_hours:
        yield (
            f"{policy.policy} allows at most {steps_a[best]:g} A here: {finish.max_ah / MARGIN:.0f} Ah take "
            f"{hours:.1f} h, and {finish.max_hours:g} h are a fault ({source.at('finish.max_hours')})"
        )
    last = min(best, current.soc_pct[-1].step if current.soc_pct else best)
    if finish.taper is not None and steps_a[last] <= finish.taper.below_a:
        yield (
            f"{policy.policy} charges with {steps_a[last]:g} A at the end here, which is no more than the "
            f"{finish.taper.below_a:g} A of a taper: full right above {finish.taper.above_v:g} V "
            f"({source.at('finish.taper')})"
        )


LINT = {"policy": policy_lint, "station": station_lint}
