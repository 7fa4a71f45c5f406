"""What to write in place of keys from the older policy format, which used a charger's steps instead of amperes."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from orchestrator.config.amperes import CELL_VOLTS
from orchestrator.config.policy import Band, Finish, Pack, PrechargeRule
from orchestrator.config.yaml.tree import Entries, Items, Node, Scalar
from orchestrator.keys import Range

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
        return "a policy speaks of amperes today: write max_a"
    step = int(node.text)
    if amps := y.amps(step):
        return f"a policy speaks of amperes today: write max_a: {amps} (step {step + 1} of this station's charger)"
    return (
        f"a policy speaks of amperes today: write max_a with those of step {step + 1} of 5, the charger's "
        f"steps_a[{step}]; `orchestrator check STATION` works them out"
    )


def _target(_y: Yesterday, node: Node) -> str:
    text = node.text if isinstance(node, Scalar) else "100"
    if text == "100":
        return "write full: {soc_pct: 100} where the BMU's SOC is to end the charge, else leave it out"
    return f"write target_soc_pct: {text}"


def _taper(_y: Yesterday, node: Node) -> str:
    if not isinstance(node, Entries):
        return "write it below `full:`"
    inner = ", ".join(f"{name.text}: {value.text}" for name, value in node.entries if isinstance(value, Scalar))
    return f"write it below `full:`, full: {{taper: {{{inner}}}}}"


def _charger(_y: Yesterday, node: Node) -> str:
    text = node.text if isinstance(node, Scalar) else "true"
    return f"write it below `full:`, full: {{charger: {text}}}"


_RETIRED: Mapping[tuple[type, str], Callable[[Yesterday, Node], str]] = {
    (Band, "step"): _row,
    (Finish, "soc_pct"): _target,
    (Finish, "taper"): _taper,
    (Finish, "charger_full"): _charger,
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
    return f"with the step {y.highest + 1} of yesterday write current_a: {amps}, if the data sheet allows as much"


def _precharge(y: Yesterday, _values: Values) -> str:
    amps = y.amps(0)
    return f"with this station's charger write max_a: {amps}, its lowest step" if amps else ""


_NEW: Mapping[tuple[type, str], Callable[[Yesterday, Values], str]] = {
    (Pack, "chemistry"): _chemistry,
    (Pack, "current_a"): _current,
    (PrechargeRule, "max_a"): _precharge,
}

#: For a table that was a list in the older format, and is now a group with `rows`.
ROWS = "a table has its rows below `rows:` today: write {name}: {{rows: [{{from: …, to: …}}, …]}}"
