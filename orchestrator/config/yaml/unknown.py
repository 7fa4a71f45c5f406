"""What somebody may have meant by a key that a record does not have."""

import re
from dataclasses import dataclass

from orchestrator.config.yaml.scalars import nearest
from orchestrator.config.yaml.schema import Slot, places, slots


@dataclass(frozen=True, slots=True)
class Meant:
    """What to say about the key, and the key that it is nearly, if any."""

    hint: str
    slot: Slot | None


def unknown_key(name: str, record: type, references: frozenset[type], *, guess: bool) -> Meant:
    """Names the place below which the key belongs, else, with `guess`, the one that is spelt nearly the same.

    `references`: the types that are described in a file of their own.
    """
    known = slots(record)
    allowed = f"llowed here: {', '.join(known)}"
    where = [place.rpartition(".")[0] for place in places(record, references) if place.rpartition(".")[2] == name]
    if where:
        return Meant(f"it belongs below {' or '.join(where)}, indented; a{allowed}", None)
    if (pair := re.fullmatch(r"(\w+)(?: *= *|[: ] *)(.*)", name)) and pair[1] in known:
        return Meant(f"write {pair[1]}: {pair[2]}", None)
    near = nearest(name, known) if guess else ""
    return Meant(f"did you mean {near}? A{allowed}", known[near]) if near else Meant(f"a{allowed}", None)
