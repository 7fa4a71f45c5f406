"""Warnings about entries that ask of cells and instruments what they cannot do, for `orchestrator check`.

What is asked here is usual practice, not a data sheet: cold, full, aged and deeply discharged cells bear less current
than others, honest instruments differ by a little, and no charge exceeds the capacity by much.
"""

from collections.abc import Callable, Iterator, Mapping

from orchestrator.config.amperes import CELL_VOLTS, RESOLUTION, row_a
from orchestrator.config.policy import Band, CellType
from orchestrator.config.rules import Problems, Rule, problems
from orchestrator.core.cells import CHEMISTRIES, EMPTY_PCT
from orchestrator.keys import Range

#: Graphite takes up lithium slowly below this; lithium titanate has no graphite.
FROST_C, FROST_SHARE_C = 5.0, 0.2
#: More than this is no ordinary cell's charging current.
QUICK_C = {CellType.NMC: 2.0, CellType.NCA: 2.0, CellType.LFP: 2.0, CellType.LTO: 10.0}
#: Between these the temperature, and above this SOC the charge, decide nothing alone.
WARM_C, HOT_C, HALF_PCT = 25.0, 35.0, 50.0
#: Two honest instruments differ by so much: below it a threshold sees their noise.
LEAST: Mapping[str, tuple[float, str, str]] = {
    "faults.volts_differ_v": (0.2, "V", "two honest instruments and a cable differ by that"),
    "faults.amps_differ_a": (0.3, "A", "two honest instruments differ by that"),
    "faults.over_current_pct": (103.0, "%", "a charger's own current is no more exact than that"),
    "faults.temperature_rise_k_per_min": (0.2, "K/min", "a sensor's last digit and a draught change by that"),
    "precharge.rise.volts": (0.1, "V", "the last digits of an instrument change by that"),
    "finish.full.taper.below_a": (0.1, "A", "no current is measured so exactly: the taper is never seen"),
}
#: A pack whose charge exceeds its capacity by half is damaged, or the capacity is another one.
BEYOND = 1.5


def _top(voltage_v: Range, kind: CellType, cells: int) -> Problems:
    end_v = round(CELL_VOLTS[kind].end_v * cells, 2)
    if CELL_VOLTS[kind].least_v * cells <= voltage_v.high <= end_v:
        yield (
            "pack.voltage_v[1]",
            f"{voltage_v.high:g} V leaves no room: {cells} {kind} cells are full at {end_v:.1f} V, and a charger that "
            f"goes up to there latches the bay; {1.01 * end_v:.1f} V, say",
        )


def _quick(current_a: float, capacity_ah: float, kind: CellType) -> Problems:
    if current_a > QUICK_C[kind] * capacity_ah:
        yield (
            "pack.current_a",
            f"{current_a:g} A are {current_a / capacity_ah:.1f} C: is that the charging current of the data sheet, not "
            "the discharging one?",
        )


def _most(max_ah: float, capacity_ah: float) -> Problems:
    if max_ah > BEYOND * capacity_ah:
        yield (
            "finish.max_ah",
            f"{max_ah:g} Ah protect nothing: the pack holds {capacity_ah:g} Ah; 110 % of it is the default",
        )


def _noise(at: str, least: float, unit: str, why: str) -> Rule:
    def test(value: float) -> Problems:
        if value < least:
            yield at, f"{value:g} {unit} is below {least:g} {unit}: {why}"

    return Rule(test, (at,))


def _hysteresis(name: str) -> Rule:
    at, (resolution, unit) = f"current.{name}.hysteresis", RESOLUTION[name]

    def test(value: float) -> Problems:
        if 0 < value < resolution:
            yield at, f"{value:g} {unit} has no effect: the BMU's resolution is {resolution:g} {unit}"

    return Rule(test, (at,))


_RULES = (
    Rule(_top, ("pack.voltage_v", "pack.chemistry", "pack.cells_in_series")),
    Rule(_quick, ("pack.current_a", "pack.capacity_ah", "pack.chemistry")),
    Rule(_most, ("finish.max_ah", "pack.capacity_ah")),
    *(_noise(at, *known) for at, known in LEAST.items()),
    *(_hysteresis(name) for name in RESOLUTION),
)


def physics_lint(values: Mapping[str, object]) -> Problems:
    """What is allowed by a policy but hardly by its cells, by the paths of its keys."""
    yield from problems(_RULES, values)
    kind, cells = values.get("pack.chemistry"), values.get("pack.cells_in_series")
    current_a, capacity_ah = values.get("pack.current_a"), values.get("pack.capacity_ah")
    if not (isinstance(kind, CellType) and isinstance(cells, int) and isinstance(current_a, float)):
        return
    capacity = capacity_ah if isinstance(capacity_ah, float) else None
    allowed = {
        name: [(row, row_a(row, current_a, capacity)) for row in rows]
        for name in RESOLUTION if isinstance(rows := values.get(f"current.{name}.rows"), tuple)
    }  # fmt: skip
    yield from _frost(allowed.get("temperature_c", []), kind, capacity)
    for name, less in _less(kind, cells).items():
        yield from _falls(name, allowed.get(name, []), less)
    yield from _taper(values, allowed, capacity)


def _frost(rows: list[tuple[Band, float]], kind: CellType, capacity_ah: float | None) -> Problems:
    for number, (row, amps) in enumerate(rows):
        if kind is not CellType.LTO and capacity_ah and row.from_ < FROST_C and amps > FROST_SHARE_C * capacity_ah:
            yield (
                f"current.temperature_c.rows[{number}]",
                f"{amps:g} A from {row.from_:g} °C on, {amps / capacity_ah:.2g} C: cold cells plate lithium; below "
                f"{FROST_C:g} °C {FROST_SHARE_C / 2:g} C is usual",
            )


#: (row, its neighbour nearer to the middle) → why the row may allow no more than that; "" if nothing is known.
Less = Callable[[Band, Band], str]


def _less(kind: CellType, cells: int) -> Mapping[str, Less]:
    curve = CHEMISTRIES[kind]
    empty_v, half_v = curve.ocv_v(EMPTY_PCT) * cells, curve.ocv_v(HALF_PCT) * cells

    def temperature(row: Band, other: Band) -> str:
        if row.from_ < other.from_:
            return "the colder a pack, the less it bears" if other.from_ <= WARM_C else ""
        return "the hotter a pack, the less it bears" if row.from_ >= HOT_C else ""

    def charge(row: Band, other: Band) -> str:
        return "the fuller a pack, the less it takes" if row.from_ > other.from_ and row.from_ >= HALF_PCT else ""

    def health(row: Band, other: Band) -> str:
        return "the older a pack, the less it bears" if row.from_ < other.from_ else ""

    def volts(row: Band, other: Band) -> str:
        if row.from_ < other.from_:
            return "a nearly empty pack bears less" if other.from_ <= empty_v else ""
        return "the fuller a pack, the less it takes" if row.from_ >= half_v else ""

    return {"temperature_c": temperature, "soc_pct": charge, "soh_pct": health, "voltage_v": volts}


def _falls(name: str, rows: list[tuple[Band, float]], less: Less) -> Problems:
    """Rows that allow more than a neighbour which bears more."""
    for number, (row, amps) in enumerate(rows):
        for other, most_a in _neighbours(rows, number):
            if amps > most_a and (why := less(row, other)):
                text = f"{amps:g} A, and the row from {other.from_:g} to {other.to:g} allows {most_a:g} A: {why}"
                yield f"current.{name}.rows[{number}]", text


def _neighbours(rows: list[tuple[Band, float]], number: int) -> Iterator[tuple[Band, float]]:
    yield from rows[max(0, number - 1) : number]
    yield from rows[number + 1 : number + 2]


def _taper(
    values: Mapping[str, object], allowed: Mapping[str, list[tuple[Band, float]]], capacity_ah: float | None
) -> Problems:
    """A taper that would be there before the current has fallen (`core/finish.py` then asks for half of it)."""
    amps, share = values.get("finish.full.taper.below_a"), values.get("finish.full.taper.below_c")
    key = "below_a"
    if isinstance(share, float) and capacity_ah is not None:
        amps, key = round(share * capacity_ah, 3), "below_c"
    last = [rows[-1][1] for name in ("soc_pct", "voltage_v") if (rows := allowed.get(name)) and rows[-1][1] > 0]
    if isinstance(amps, float) and last and min(last) <= amps:
        yield (
            f"finish.full.taper.{key}",
            f"{amps:g} A is no less than a nearly full pack is allowed, {min(last):g} A: half of the step's current is "
            "in force instead",
        )
