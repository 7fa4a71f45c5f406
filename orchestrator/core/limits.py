"""The current-limit step: of all that limits it the lowest wins, and has a name. Down at once, up after a hold."""

from orchestrator.config.policy import Table
from orchestrator.core.facts import Facts
from orchestrator.model import ActiveFault, Cause, Effect, Step

#: (step, what limits it, for whom: the key in policy or station, the value)
Bound = tuple[int, str, str, float | None]


def choose(f: Facts, worst: ActiveFault | None) -> tuple[Step, float | None]:
    """The step for now, and since when a higher one has been allowed (None: none is).

    `worst` is the worst of the faults in force; LIMIT, and what is worse, means the lowest step.
    """
    bound = _lowest(f, worst)
    before, raise_s = f.memory.step, f.memory.raise_s
    if before is None or bound[0] < before.index:
        return _step(f, bound), None
    if bound[0] == before.index:
        return (before if _same_rule(before, bound) else _step(f, bound)), None
    raise_s = raise_s if raise_s is not None else f.now_s
    if f.now_s - raise_s >= f.rules.policy.current.raise_after_s:
        return _step(f, bound), None
    return before, raise_s


def _lowest(f: Facts, worst: ActiveFault | None) -> Bound:
    current = f.rules.policy.current
    lowest: Bound = (len(f.rules.steps_a) - 1, "the highest step, nothing limits it", "", None)
    if f.rules.top_step < lowest[0]:
        lowest = (f.rules.top_step, "the station's current limit", "limits.current_a", None)
    if worst is not None and worst.effect >= Effect.LIMIT:
        lowest = (0, f"the fault {worst.id}", "", None)
    for name, table, value in (
        ("temperature_c", current.temperature_c, f.temperature_c),
        ("soc_pct", current.soc_pct, f.soc),
        ("soh_pct", current.soh_pct, f.soh),
        ("voltage_v", current.voltage_v, f.pack_v),
    ):
        if table is None:
            continue
        row = _row(table, value)
        step = table[row].step if row is not None else 0
        if step < lowest[0]:
            lowest = (step, name, f"current.{name}[{row}]" if row is not None else f"current.{name}", value)
    return lowest


def _row(table: Table, value: float | None) -> int | None:
    """The index of the band that `value` lies in; the last band includes its end."""
    if value is None:
        return None
    for index, band in enumerate(table):
        if band.from_ <= value < band.to:
            return index
    return len(table) - 1 if value == table[-1].to else None


#: How each quantity is said: its name, its number format with unit.
WORDS = {
    "temperature_c": ("temperature", "{:.1f} °C"),
    "soc_pct": ("SOC", "{:.0f} %"),
    "soh_pct": ("SOH", "{:.0f} %"),
    "voltage_v": ("pack voltage", "{:.2f} V"),
}


def _step(f: Facts, bound: Bound) -> Step:
    index, what, path, value = bound
    return Step(index, f.rules.steps_a[index], _rule(f, what, path, value))


def _rule(f: Facts, what: str, path: str, value: float | None) -> Cause:
    place = f.rules.policy.source.at(path) if what in WORDS else f.rules.bay.source.at(path) if path else ""
    return Cause.of("limit", key=path, place=place, text=_text(f, what, path, value))


def _text(f: Facts, what: str, path: str, value: float | None) -> str:
    if what not in WORDS:
        return f"{what}, {f.rules.bay.source.at(path)}" if path else what
    name, form = WORDS[what]
    place = f.rules.policy.source.at(path)
    if value is None:
        return f"{name} unknown, {place}"
    table: Table = getattr(f.rules.policy.current, what)
    row = _row(table, value)
    where = f"in {table[row].from_:g} … {table[row].to:g}" if row is not None else "outside of its table"
    return f"{name} {form.format(value)} {where}, {place}"


def _same_rule(before: Step, bound: Bound) -> bool:
    """Whether the step that is in force is bound by the same line of a table; its sentence then keeps its value."""
    _, what, path, _ = bound
    return what in WORDS and before.rule.key == path
