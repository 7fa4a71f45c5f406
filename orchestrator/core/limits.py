"""From what a policy allows, in amperes, to the charger's step: the highest step whose worst case stays within it.

Of all limits that apply the lowest wins, identified by its key, however it is worded. The step goes down at once, and
up after a hold. `core/rows.py` tracks which rows apply.
"""

from collections.abc import Iterator
from itertools import chain

from orchestrator.config.amperes import RESOLUTION, highest_step, hysteresis, ranges
from orchestrator.config.policy import Band, Where
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Memory
from orchestrator.core.rows import values
from orchestrator.core.rules import Bound, Rules
from orchestrator.model import ActiveFault, Cause, CurrentStep, Effect, Snapshot

# --- how much they allow ----------------------------------------------------------------------------------------------


def bounds(f: Facts, worst: ActiveFault | None) -> Iterator[Bound]:
    """Everything that limits the current now.

    `worst` is the worst active fault; an effect of LIMIT or worse means the lowest step.
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
        if known[name] is None or row is None:  # another rule ends a charge that no row covers
            yield Bound(rules.worst_a[0], f"current.{name}")
        else:
            yield allowed[row]
    for name, number in rows.items():
        if name.startswith("where"):
            yield rules.where_bounds[number]


def lowest(f: Facts, worst: ActiveFault | None = None) -> Bound:
    """What limits the current most; of equals, the first."""
    least = f.rules.pack_bound
    for bound in bounds(f, worst):
        if bound.allowed_a < least.allowed_a:
            least = bound
    return least


def supplied(f: Facts, bound: Bound) -> Bound:
    """What the bay's supply grants, if that is less."""
    level, why, worst_a = f.snapshot.granted, f.snapshot.granted_why, f.rules.worst_a
    if level is None or why is None or level >= len(worst_a):
        return bound
    granted = Bound(worst_a[level - 1] if level else 0.0, why.key)
    return granted if granted.allowed_a < bound.allowed_a else bound


def none_allowed(f: Facts) -> Cause | None:
    """Why not even the lowest step is allowed; None if it is. Unknown values are handled by another rule."""
    bound = lowest(f)
    if bound.allowed_a > 0 and (not f.rules.manual or highest_step(bound.allowed_a, f.rules.worst_a) is not None):
        return None
    rule = limit(f, bound)
    if bound.allowed_a == 0:
        return rule
    return Cause.of("below_lowest_step", key=rule.key, place=rule.place, rule=rule, lowest_a=f.rules.worst_a[0])


def choose(f: Facts, worst: ActiveFault | None) -> tuple[CurrentStep, float | None]:
    """The step for now, and since when a higher one has been allowed (None: none is)."""
    bound = supplied(f, lowest(f, worst))
    index = highest_step(bound.allowed_a, f.rules.worst_a) or 0  # if none is allowed, the charge has been ended
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


def _step(f: Facts, index: int, bound: Bound) -> CurrentStep:
    return CurrentStep(index, f.rules.steps_a[index], limit(f, bound))


# --- as causes --------------------------------------------------------------------------------------------------------

#: The parameter for each quantity in a cause.
PARAMS = {"temperature_c": "pack_c", "soc_pct": "soc_pct", "soh_pct": "soh_pct", "voltage_v": "pack_v"}
#: The words for them.
WORDS = {"temperature_c": "temperature", "soc_pct": "soc", "soh_pct": "soh", "voltage_v": "pack_voltage"}


def limit(f: Facts, bound: Bound) -> Cause:
    """What limits the current: the row or key, with the evidence and its place in the file."""
    why = f.snapshot.granted_why
    if why is not None and bound.key == why.key:
        return why
    id_, params = _what(f, bound)
    return Cause(id_, params, bound.key, _place(f, bound.key))


def present(key: str, snapshot: Snapshot, memory: Memory, rules: Rules) -> Cause | None:
    """The rule with this key of a table with the present values; None for any other key. `memory` is the newest."""
    bound = next((one for one in _rows(rules) if one.key == key), None)
    if bound is None or memory.last_s is None:
        return None
    return limit(Facts.of(memory.last_s, snapshot, memory, rules), bound)


def _rows(rules: Rules) -> Iterator[Bound]:
    """The bound of each row, and of each rule of `where`."""
    return chain(*rules.table_bounds, rules.where_bounds)


def _place(f: Facts, key: str) -> str:
    """Where a key stands; "" if it is in no file."""
    if not key or key.startswith("fault "):
        return ""
    return (f.rules.bay.source if key.startswith("limits.") else f.rules.policy.source).at(key)


def _what(f: Facts, bound: Bound) -> tuple[str, tuple[tuple[str, object], ...]]:
    """The id and the parameters."""
    key, row = bound.key, bound.row
    if not key:
        return "limit_none", ()
    if key.startswith("fault "):
        return "limit_fault", (("fault", key.removeprefix("fault ")),)
    if key == "pack.current_a":
        return "limit_pack", (("allowed_a", bound.allowed_a),)
    if key.startswith("limits."):
        return "limit_station", (("allowed_a", bound.allowed_a),)
    if row is None:
        name = key.removeprefix("current.")
        value = values(f)[name]
        if value is None:
            return "limit_unknown", (("quantity", WORDS[name]),)
        return "limit_outside", (("value", _value(name, value)),)
    return "limit_row", (("spans", _spans(f, bound, row)), ("allows", _allows(bound.allowed_a, row)))


def _spans(f: Facts, bound: Bound, row: Band | Where) -> tuple[Cause, ...]:
    """Each quantity that the row is about."""
    if isinstance(row, Band):
        name = next(name for name in RESOLUTION if bound.key.startswith(f"current.{name}."))
        return (_span(f, name, row.from_, row.to, bound.key),)
    return tuple(_span(f, name, span.low, span.high, bound.key) for name, span in ranges(row).items())


def _span(f: Facts, name: str, low: float, high: float, key: str) -> Cause:
    """A value and its row: the row it is in, or one it was in and is not yet well outside of."""
    value = values(f)[name]
    if value is None:
        return Cause.of("span_unknown", quantity=WORDS[name])
    said = _value(name, value)
    if low <= value <= high:
        return Cause.of("span_in", value=said, low=low, high=high)
    if all(key != bound.key for bound in bounds(f, None)):
        return Cause.of("span_left", value=said, low=low, high=high)
    well = hysteresis(f.rules.policy.current, name)
    if not low - well < value < high + well:
        return Cause.of("span_kept", value=said, low=low, high=high)
    return Cause.of("span_near", value=said, well=well, low=low, high=high)


def _value(name: str, value: float) -> Cause:
    return Cause(f"value_{name}", ((PARAMS[name], value),))


def _allows(allowed_a: float, row: Band | Where) -> Cause:
    if allowed_a == 0:
        return Cause("allows_nothing")
    if row.max_c is None:
        return Cause.of("allows_a", allowed_a=allowed_a)
    return Cause.of("allows_c", allowed_a=allowed_a, max_c=row.max_c)
