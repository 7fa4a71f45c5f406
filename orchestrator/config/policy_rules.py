"""Rules between the keys of one policy."""

from collections.abc import Mapping

from orchestrator.config.amperes import CELL_VOLTS, END_SHARE
from orchestrator.config.current_rules import CURRENT_RULES, amperes_problems
from orchestrator.config.names import name_problem
from orchestrator.config.policy import CellType
from orchestrator.config.rules import Problems, Rule, problems
from orchestrator.keys import Range

CELL_V = Range(2.0, 4.35)  #: no lithium cell is charged outside: below it copper dissolves; above it exceeds LiHV
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


def _precharge_a(max_a: float, current_a: float) -> Problems:
    if max_a > current_a:
        yield "precharge.max_a", f"{max_a:g} A is above pack.current_a, {current_a:g} A, the most that the pack bears"


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


def _start(start_pct: float, target_pct: float) -> Problems:
    if start_pct > target_pct:
        yield (
            "start.soc_below_pct",
            f"{start_pct:g} % is above finish.target_soc_pct, {target_pct:g} %: a charge would be over when it begins",
        )


def _recharge(recharge_pct: float, target_pct: float) -> Problems:
    if recharge_pct >= target_pct:
        yield (
            "recharge.soc_below_pct",
            f"{recharge_pct:g} % must be below finish.target_soc_pct, {target_pct:g} %: else a full battery is charged "
            "again",
        )


def _chemistry(kind: CellType, cells: int, voltage_v: Range) -> Problems:
    """The voltage must not exceed what the cells bear; lint warns of a low one that is probably unintended."""
    most_v = CELL_VOLTS[kind].most_v
    if round(voltage_v.high / cells, 3) in CELL_V and voltage_v.high > round(most_v * cells, 3):
        yield (
            "pack.chemistry",
            f"{voltage_v.high:g} V on {cells} cells is {voltage_v.high / cells:.2f} V a cell; "
            f"{kind} bears {most_v:.2f} V",
        )


def _frost(kind: CellType, temperature_c: Range) -> Problems:
    coldest_c = CELL_VOLTS[kind].coldest_c
    if temperature_c.low < coldest_c:
        yield (
            "pack.temperature_c[0]",
            f"{temperature_c.low:g} °C: {kind} cells plate lithium below {coldest_c:g} °C, at any current",
        )


def _taper(above_v: float, kind: CellType, cells: int, voltage_v: Range) -> Problems:
    """A low current early in the charge does not mean full."""
    end_v = min(CELL_VOLTS[kind].end_v * cells, voltage_v.high)
    if above_v < round(END_SHARE * end_v, 2):
        yield (
            "finish.full.taper.above_v",
            f"{above_v:g} V is too low: a taper is believed within 3 % of the end voltage, {end_v:.1f} V, so from "
            f"{END_SHARE * end_v:.1f} V on",
        )


def _trip(trip_c: float, temperature_c: Range) -> Problems:
    if trip_c <= temperature_c.high:
        yield (
            "pack.temperature_c[1]",
            f"{temperature_c.high:g} °C must be below faults.temperature_trip_c, {trip_c:g} °C: "
            "at the one the bay pauses, at the other it latches",
        )


def _limits(values: Mapping[str, object]) -> Problems:
    """Keys whose default needs the capacity, and keys that make no sense together."""
    if "pack.capacity_ah" in values and values["pack.capacity_ah"] is None:
        for key, what in (("finish.max_hours", "the longest charge"), ("finish.max_ah", "the largest one")):
            if key in values and values[key] is None:
                yield key, f"write it, or write pack.capacity_ah, from which {what} is worked out"
        if values.get("finish.full.taper") is not None and values.get("finish.full.taper.below_a") is None:
            yield "finish.full.taper", "write below_a, or write pack.capacity_ah, from which it is worked out"
    if values.get("finish.full.taper.below_a") is not None and values.get("finish.full.taper.below_c") is not None:
        yield "finish.full.taper.below_c", "write below_a or below_c, not both"
    if values.get("finish.full_every_days") is not None and values.get("finish.target_soc_pct") == 100:
        yield "finish.full_every_days", "only with a target_soc_pct below 100: with 100 every charge goes all the way"
    if values.get("finish.full.needs") == "all" and not _signs(values):
        yield "finish.full.needs", "all of nothing: write soc_pct, taper or charger below finish.full"


def _signs(values: Mapping[str, object]) -> list[object]:
    names = ("soc_pct", "taper", "charger")
    return [value for name in names if (value := values.get(f"finish.full.{name}")) not in (None, False)]


def policy_problems(values: Mapping[str, object]) -> Problems:
    """The findings of all rules in one policy; keys that are already findings are skipped."""
    yield from problems(POLICY_RULES, values)
    yield from _limits(values)
    yield from amperes_problems(values)


POLICY_RULES: tuple[Rule, ...] = (
    Rule(_name, ("policy",)),
    Rule(_cells, ("pack.cells_in_series", "pack.voltage_v")),
    _inside_pack("precharge.below_v"),
    _inside_pack("precharge.pulse.until_v"),
    _inside_pack("finish.full.taper.above_v"),
    Rule(_chemistry, ("pack.chemistry", "pack.cells_in_series", "pack.voltage_v")),
    Rule(_frost, ("pack.chemistry", "pack.temperature_c")),
    Rule(_taper, ("finish.full.taper.above_v", "pack.chemistry", "pack.cells_in_series", "pack.voltage_v")),
    Rule(_pulse, ("precharge.pulse.until_v", "precharge.below_v")),
    Rule(_precharge_a, ("precharge.max_a", "pack.current_a")),
    Rule(_precharge_time, ("precharge.pulse.max_min", "precharge.continuous.max_min")),
    Rule(_rise, ("precharge.rise.within_min", "precharge.pulse.max_min", "precharge.continuous.max_min")),
    Rule(_start, ("start.soc_below_pct", "finish.target_soc_pct")),
    Rule(_recharge, ("recharge.soc_below_pct", "finish.target_soc_pct")),
    Rule(_trip, ("faults.temperature_trip_c", "pack.temperature_c")),
    *CURRENT_RULES,
)
