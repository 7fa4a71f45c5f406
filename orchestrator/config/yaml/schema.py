"""The shape of a record's YAML: its keys, read once from the dataclass."""

import dataclasses
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, is_dataclass
from functools import cache
from typing import Any, Final, get_args, get_type_hints

from orchestrator.keys import KeyRule, Range

INVALID: Final = object()  #: stands in for a value that is already a finding


@dataclass(frozen=True, slots=True)
class Slot:
    """One key of a record: its name in YAML, its field, its type and its description."""

    name: str
    field: str
    hint: Any
    key: KeyRule
    default: object  #: INVALID if the key is required


@cache
def slots(record: type) -> dict[str, Slot]:
    """A record's keys in YAML, in the order of its fields."""
    hints = get_type_hints(record)
    found = {}
    for field in dataclasses.fields(record):
        if "key" in field.metadata:
            default: object = INVALID
            if field.default is not dataclasses.MISSING:
                default = field.default
            elif field.default_factory is not dataclasses.MISSING:
                default = field.default_factory()
            name = field.name.removesuffix("_")
            found[name] = Slot(name, field.name, hints[field.name], field.metadata["key"], default)
    return found


@cache
def places(record: type, elsewhere: frozenset[type], prefix: str = "") -> tuple[str, ...]:
    """Dotted paths of all keys nested below a record's own, excluding those of other files."""
    found: list[str] = []
    for slot in slots(record).values():
        for inner in _types(slot.hint):
            if is_dataclass(inner) and inner not in {Range, *elsewhere}:
                below = join(prefix, slot.name)
                found += [f"{below}.{name}" for name in slots(inner)]
                found += places(inner, elsewhere, below)
    return tuple(found)


def _types(hint: Any) -> Iterator[type]:  # noqa: ANN401 - any type expression
    """The plain types inside a type expression: `tuple[Band, ...] | None` → Band, None."""
    if isinstance(hint, type) and not get_args(hint):
        yield hint
    for inner in get_args(hint):
        yield from _types(inner)


def join(path: str, name: str) -> str:
    """The dotted path of a key below `path`."""
    return f"{path}.{name}" if path else name


def told_keys(known: Iterable[Slot]) -> str:
    """The keys of a record, those that must be there first."""
    required: list[str] = []
    optional: list[str] = []
    for slot in known:
        (required if slot.default is INVALID else optional).append(slot.name)
    told = [f"the key{'s' * (len(required) > 1)} {', '.join(required)}"] if required else []
    more = "if wanted " if required else "any of the keys "
    return ", and ".join([*told, *([f"{more}{', '.join(optional)}"] if optional else [])])
