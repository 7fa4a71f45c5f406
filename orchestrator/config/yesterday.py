"""What to write in place of keys from the older policy format, which used a charger's steps instead of amperes."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from orchestrator.config.amperes import CELL_VOLTS
from orchestrator.config.policy import Band, Finish, Pack, PrechargeRule
from orchestrator.config.yaml.tree import Entries, Items, Node, Scalar
from orchestrator.keys import Range

IN_AMPERES = "a policy is written in amperes now"
#: A charge to here was no target of its own: it was one sign of a full pack.
_ALL = "100"
#: The signs of a full pack, with their keys below `full:`.
_SIGNS = {"soc_pct": "soc_pct", "taper": "taper", "charger_full": "charger"}
_STEP = re.compile(r"[0-4]", re.ASCII)
Steps = tuple[float, ...]
Values = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Yesterday:
    """The messages for one policy file; `steps_a` come from the station being checked, if any."""

    tree: Node | None = None
    steps_a: Steps = ()
    highest: int | None = field(init=False)

    def __post_init__(self) -> None:
        found = [int(step) for step in _steps(self.tree)] if self.tree is not None else []
        object.__setattr__(self, "highest", max(found, default=None))

    def instead(self, record: type, name: str, node: Node) -> str:
        """What to write in place of this key; "" if it never existed."""
        says = _RETIRED.get((record, name))
        return says(self, node) if says is not None else ""

    def missing(self, record: type, name: str, values: Values) -> str:
        """What to write for a missing key; "" if that cannot be determined."""
        says = _NEW.get((record, name))
        return says(self, values) if says is not None else ""

    def amps(self, step: int) -> str:
        """The amperes of a step; "" if they are not known."""
        if step < len(self.steps_a):
            return f"{self.steps_a[step]:g}"
        return ""


def _steps(node: Node) -> Iterator[str]:
    """Every `step: n` in the file."""
    if isinstance(node, Items):
        for item in node.items:
            yield from _steps(item)
    elif isinstance(node, Entries):
        for name, value in node.entries:
            if name.text == "step" and isinstance(value, Scalar) and _STEP.fullmatch(value.text):
                yield value.text
            yield from _steps(value)


def _row(y: Yesterday, node: Node) -> str:
    if not isinstance(node, Scalar) or not _STEP.fullmatch(node.text):
        return f"{IN_AMPERES}: write max_a"
    step = int(node.text)
    if amps := y.amps(step):
        return f"{IN_AMPERES}: write max_a: {amps} (step {step + 1} of this station's charger)"
    return (
        f"{IN_AMPERES}: write max_a with the amperes of the charger's step {step + 1} (of 5); "
        "`orchestrator check STATION` tells them"
    )


def _target(y: Yesterday, node: Node) -> str:
    text = node.text if isinstance(node, Scalar) else _ALL
    return _full(y, node) if text == _ALL else f"write target_soc_pct: {text}"


def _full(y: Yesterday, node: Node) -> str:
    """One `full:` for all signs in the file, told at the first of them: a second `full:` would be refused."""
    signs = list(_signs(y.tree))
    if not signs:
        return "write it below `full:`"
    if node is not signs[0][0]:
        return "goes into that one `full:`"
    whole = f"write full: {{{', '.join(text for _, text in signs)}}}"
    if len(signs) > 1:
        whole += ", one key for all of these"
    trusts = "; leave soc_pct out of it if the BMU's SOC is not to end the charge"
    return whole + (trusts if any(text.startswith("soc_pct") for _, text in signs) else "")


def _signs(tree: Node | None) -> Iterator[tuple[Node, str]]:
    """Every sign of a full pack in the old `finish`, as it is written below `full:`."""
    for name, node in _entries(_get(tree, "finish")):
        if name in _SIGNS and not (name == "soc_pct" and isinstance(node, Scalar) and node.text != _ALL):
            yield node, f"{_SIGNS[name]}: {_written(node)}"


def _written(node: Node) -> str:
    if isinstance(node, Scalar):
        return node.text
    return f"{{{', '.join(f'{name}: {_written(value)}' for name, value in _entries(node))}}}"


def _entries(node: Node | None) -> Iterator[tuple[str, Node]]:
    yield from ((name.text, value) for name, value in node.entries) if isinstance(node, Entries) else ()


def _get(node: Node | None, key: str) -> Node | None:
    return dict(_entries(node)).get(key)


_RETIRED: Mapping[tuple[type, str], Callable[[Yesterday, Node], str]] = {
    (Band, "step"): _row,
    (Finish, "soc_pct"): _target,
    (Finish, "taper"): _full,
    (Finish, "charger_full"): _full,
}


def _chemistry(_y: Yesterday, values: Values) -> str:
    cells, voltage_v = values.get("pack.cells_in_series"), values.get("pack.voltage_v")
    if not isinstance(cells, int) or not isinstance(voltage_v, Range):
        return ""
    cell_v = voltage_v.high / cells
    fits = [kind.value for kind, volts in CELL_VOLTS.items() if volts.least_v <= cell_v <= volts.most_v]
    return f"at {cell_v:.2f} V a cell write chemistry: {' or '.join(fits)}" if fits else ""


def _current(y: Yesterday, _values: Values) -> str:
    if y.highest is None or not (amps := y.amps(y.highest)):
        return ""
    return (
        f"the file's highest step, {y.highest + 1}, is {amps} A: write current_a: {amps}, if the data sheet allows it"
    )


def _precharge(y: Yesterday, _values: Values) -> str:
    amps = y.amps(0)
    return f"write max_a: {amps}, the lowest step of this station's charger" if amps else ""


_NEW: Mapping[tuple[type, str], Callable[[Yesterday, Values], str]] = {
    (Pack, "chemistry"): _chemistry,
    (Pack, "current_a"): _current,
    (PrechargeRule, "max_a"): _precharge,
}

#: For a table that was a list in the older format, and is now a group with `rows`.
ROWS = "a table now has its rows below `rows:`: write {name}: {{rows: [{{from: …, to: …}}, …]}}"
