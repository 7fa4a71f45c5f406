"""What must hold between the supplies of a station, and between them and its bays."""

from collections.abc import Collection, Iterator, Mapping

from orchestrator.config.names import name_problem
from orchestrator.config.rules import Problems
from orchestrator.config.yaml.scalars import did_you_mean

Supplies = Mapping[str, Mapping[str, object]]


def supply_problems(values: Mapping[str, object], bays: Collection[str]) -> Problems:
    """All that the rules find in a station's supplies; what is a finding already is left out."""
    supplies = _supplies(values)
    for name, supply in supplies.items():
        if problem := name_problem(name):
            yield f"supplies.{name}", problem
        if (within := supply.get("within")) is not None and within not in supplies:
            yield (
                f"supplies.{name}.within",
                f"the station has no supply {within!r}; {did_you_mean(str(within), supplies)}",
            )
        elif name in (above := _above(supplies, name)):
            yield f"supplies.{name}.within", f"{name} is within itself: {' within '.join([name, *above])}"
        elif above:
            yield from _above_parent(supplies, name, above[0])
    yield from _bays(supplies, bays)


def _supplies(values: Mapping[str, object]) -> dict[str, dict[str, object]]:
    """The values of each supply by name. Names may have dots, keys have none."""
    found: dict[str, dict[str, object]] = {}
    for path, value in values.items():
        if path.startswith("supplies.") and "." in (below := path.removeprefix("supplies.")):
            name, _, key = below.rpartition(".")
            found.setdefault(name, {})[key] = value
    return found


def _above(supplies: Supplies, name: str) -> list[str]:
    """The supplies above this one, the nearest first, up to the first one met twice."""
    found: list[str] = []
    within = supplies[name].get("within")
    while isinstance(within, str) and within in supplies and within not in found:
        found.append(within)
        within = supplies[within].get("within")
    return found


def _above_parent(supplies: Supplies, name: str, parent: str) -> Problems:
    limit_w, most_w = supplies[name].get("limit_w"), supplies[parent].get("limit_w")
    if isinstance(limit_w, float) and isinstance(most_w, float) and limit_w > most_w:
        yield (
            f"supplies.{name}.limit_w",
            f"{limit_w:g} W are more than {parent} has, {most_w:g} W, and that feeds it: no more can be drawn",
        )


def _bays(supplies: Supplies, bays: Collection[str]) -> Problems:
    """Every bay that is named exists, and is in one supply, or in one and those above it."""
    first: dict[str, str] = {}
    for name, supply in supplies.items():
        for path, bay in _named(name, supply):
            other = first.setdefault(bay, name)
            if bay not in bays:
                yield path, f"the station has no bay {bay!r}; {did_you_mean(bay, bays)}"
            elif path != f"supplies.{name}.bays[{_named_at(supply, bay)}]":
                yield path, f"{bay} is named twice"
            elif other != name and name not in _above(supplies, other) and other not in _above(supplies, name):
                yield path, f"{bay} is in {other} already, and neither is within the other: it has one supply"


def _named(name: str, supply: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    bays = supply.get("bays")
    for number, bay in enumerate(bays if isinstance(bays, tuple) else ()):
        yield f"supplies.{name}.bays[{number}]", bay


def _named_at(supply: Mapping[str, object], bay: str) -> int:
    bays = supply.get("bays")
    return bays.index(bay) if isinstance(bays, tuple) else 0
