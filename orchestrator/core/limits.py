"""From what a policy allows, in amperes, to the charger's step: the highest of which the worst case is not above.

Of everything that applies the lowest wins, and has a name: its key, the same however it is worded. Down at once, up
after a hold. Which rows apply, `core/rows.py` follows.
"""

from collections.abc import Iterator

from orchestrator.config.amperes import RESOLUTION, highest_step, hysteresis, ranges
from orchestrator.config.policy import Band
from orchestrator.core.facts import Facts
from orchestrator.core.rows import values
from orchestrator.core.rules import Bound
from orchestrator.model import ActiveFault, Cause, Effect, Step

# --- how much they allow ----------------------------------------------------------------------------------------------


def bounds(f: Facts, worst: ActiveFault | None) -> Iterator[Bound]:
    """Everything that limits the current now.

    `worst` is the worst of the faults in force; LIMIT, and what is worse, means the lowest step.
    """
    rules, rows = f.rules, dict(f.memory.tables.rows)
    yield rules.pack_bound
    if rules.top_step < len(rules.steps_a) - 1:
        yield Bound(rules.worst_a[rules.top_step], "limits.current_a")
    if worst is not None and worst.effect >= Effect.LIMIT:
        yield Bound(rules.worst_a[0], f"fault {worst.id}")
    known = values(f)
    for table, allowed in zip(rules.tables, rules.table_bounds, strict=True):
        name, row = table.name, rows.get(table.name)
        if known[name] is None or row is None:  # a rule of its own ends a charge that no row covers
            yield Bound(rules.worst_a[0], f"current.{name}")
        else:
            yield allowed[row]
    for name, number in rows.items():
        if name.startswith("where"):
            yield rules.where_bounds[number]


def lowest(f: Facts, worst: ActiveFault | None = None) -> Bound:
    """What limits the current most; of equals the first."""
    least = f.rules.pack_bound
    for bound in bounds(f, worst):
        if bound.allowed_a < least.allowed_a:
            least = bound
    return least


def none_allowed(f: Facts) -> Cause | None:
    """Why not even the lowest step may be taken; None where one may. What is not known is another rule's business."""
    bound = lowest(f)
    if bound.allowed_a > 0 and (not f.rules.manual or highest_step(bound.allowed_a, f.rules.worst_a) is not None):
        return None
    rule = limit(f, bound)
    if bound.allowed_a == 0:
        return rule
    return Cause.of("below_lowest_step", key=rule.key, place=rule.place, rule=rule, lowest_a=f.rules.worst_a[0])


def choose(f: Facts, worst: ActiveFault | None) -> tuple[Step, float | None]:
    """The step for now, and since when a higher one has been allowed (None: none is)."""
    bound = lowest(f, worst)
    index = highest_step(bound.allowed_a, f.rules.worst_a) or 0  # where none is allowed a fault has ended the charge
    top = index == len(f.rules.steps_a) - 1
    before, raise_s = f.memory.stage.step, f.memory.stage.raise_s
    if before is not None and index == before.index and before.key == ("" if top else bound.key):
        return before, None
    if top:
        bound = Bound(bound.allowed_a, "")
    if before is None or index <= before.index:
        return _step(f, index, bound), None
    raise_s = raise_s if raise_s is not None else f.now_s
    if f.now_s - raise_s >= f.rules.policy.current.raise_after_s:
        return _step(f, index, bound), None
    return before, raise_s


def _step(f: Facts, index: int, bound: Bound) -> Step:
    return Step(index, f.rules.steps_a[index], limit(f, bound))


def limit(f: Facts, bound: Bound) -> Cause:
    """What limits the current, as a cause. Its sentence is still made here."""
    return Cause.of("limit", key=bound.key, place=_place(f, bound.key), text=sentence(f, bound))


# --- as sentences -----------------------------------------------------------------------------------------------------

#: How each quantity is said: its name, its number format with unit.
WORDS = {
    "temperature_c": ("temperature", "{:.1f} °C"),
    "soc_pct": ("SOC", "{:.0f} %"),
    "soh_pct": ("SOH", "{:.0f} %"),
    "voltage_v": ("pack voltage", "{:.2f} V"),
}


def _place(f: Facts, key: str) -> str:
    """Where a key stands; "" for what stands in no file."""
    if not key or key.startswith("fault "):
        return ""
    return (f.rules.bay.source if key.startswith("limits.") else f.rules.policy.source).at(key)


def sentence(f: Facts, bound: Bound) -> str:
    """What limits the current, with its evidence and its place."""
    key, place = bound.key, _place(f, bound.key)
    if not key:
        return "the highest step, nothing limits it"
    if key.startswith("fault "):
        return f"the {key}"
    if key == "pack.current_a":
        return f"the pack bears {bound.allowed_a:.1f} A, {place}"
    if key.startswith("limits."):
        return f"the station's current limit, {place}"
    if bound.row is None:
        name, form = WORDS[key.removeprefix("current.")]
        value = values(f)[key.removeprefix("current.")]
        return (
            f"{name} unknown, {place}"
            if value is None
            else f"{name} {form.format(value)} outside of its table, {place}"
        )
    return f"{_where(f, bound)} {_allows(bound)}, {place}"


def _where(f: Facts, bound: Bound) -> str:
    row, known = bound.row, values(f)
    if isinstance(row, Band):
        name = next(name for name in RESOLUTION if bound.key.startswith(f"current.{name}."))
        return _said(f, name, known[name], row.from_, row.to)
    spans = ranges(row).items() if row is not None else ()
    return " and ".join(_said(f, name, known[name], span.low, span.high) for name, span in spans)


def _said(f: Facts, name: str, value: float | None, low: float, high: float) -> str:
    """A value and the row that it is in, or was in and is not well outside of."""
    what, form = WORDS[name]
    if value is None:
        return f"{what} unknown"
    if low <= value <= high:
        return f"{what} {form.format(value)} in {low:g} … {high:g}"
    well = hysteresis(f.rules.policy.current, name)
    if not low - well < value < high + well:
        return f"{what} {form.format(value)} beyond {low:g} … {high:g}, to which it came back too often in this charge:"
    return f"{what} {form.format(value)} not yet {well:g} beyond {low:g} … {high:g}"


def _allows(bound: Bound) -> str:
    row = bound.row
    if bound.allowed_a == 0:
        return "allows no current"
    share = f" ({row.max_c:g} C)" if row is not None and row.max_c is not None else ""
    return f"allows {bound.allowed_a:.1f} A{share}"
