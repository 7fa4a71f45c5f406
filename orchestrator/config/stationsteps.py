"""What a station file's tree says before that file is read: the charger steps used with each policy, and its bays."""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from orchestrator.config.files import POLICY, find
from orchestrator.config.yaml.scalars import UnfitError
from orchestrator.config.yaml.tree import Entries, Items, Node, Scalar

Steps = tuple[float, ...]


def named_steps(node: Node, base: Path) -> dict[str, Steps]:
    """The steps in A, by each policy's real path; if chargers differ, the lowest of each. Invalid entries are skipped.

    Reading the station file reports them.
    """
    found: dict[str, Steps] = {}
    real_path = cache(lambda text: os.path.realpath(find(POLICY, text, base).path))  # many bays name the same policy
    for bay in _items(_get(node, "bays")):
        name, steps = _get(bay, "policy"), tuple(_floats(_get(_get(bay, "charger"), "steps_a")))
        if not isinstance(name, Scalar) or not steps:
            continue
        try:
            real = real_path(name.text)
        except UnfitError:
            continue
        found[real] = tuple(min(pair) for pair in zip(found.get(real, steps), steps, strict=False))
    return found


def bay_count(node: Node) -> int:
    """How many bays the file has, even if it is not valid."""
    return len(_items(_get(node, "bays")))


def _get(node: Node | None, key: str) -> Node | None:
    if not isinstance(node, Entries):
        return None
    return next((value for name, value in node.entries if name.text == key), None)


def _items(node: Node | None) -> tuple[Node, ...]:
    return node.items if isinstance(node, Items) else ()


def _floats(node: Node | None) -> Iterator[float]:
    for item in _items(node):
        try:
            yield float(item.text) if isinstance(item, Scalar) else 0.0
        except ValueError:
            return
