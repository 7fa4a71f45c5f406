"""Replaces values in a file's tree, as if they had been written there: for trying out the effect of a key."""

import re
from collections.abc import Mapping

from orchestrator.config.yaml.scalars import UnfitError
from orchestrator.config.yaml.tree import Entries, Items, Node, Scalar

#: A name, or an index in brackets: `current.soc_pct[0].to` has four parts.
_PART = re.compile(r"([^.\[\]]+)|\[(\d+)\]")


def changed(tree: Node, changes: Mapping[str, str]) -> Node:
    """The tree with the value at each dotted path replaced; missing keys are added.

    Raises UnfitError for a path that leads nowhere. The reader reports keys that the record does not have.
    """
    for path, text in changes.items():
        tree = _put(tree, [(name, index) for name, index in _PART.findall(path)], text, path)
    return tree


def _put(node: Node, parts: list[tuple[str, str]], text: str, path: str) -> Node:
    if not parts:
        if not isinstance(node, Scalar):
            raise UnfitError(f"{path} is not one value: name a key below it")
        return Scalar(node.mark, text)
    (name, index), *rest = parts
    if name:
        return _put_entry(node, name, rest, text, path)
    if not isinstance(node, Items) or int(index) >= len(node.items):
        raise UnfitError(f"{path}: there is no row [{index}]; the first one is [0]")
    items = list(node.items)
    items[int(index)] = _put(items[int(index)], rest, text, path)
    return Items(node.mark, tuple(items))


def _put_entry(node: Node, name: str, rest: list[tuple[str, str]], text: str, path: str) -> Node:
    if not isinstance(node, Entries):
        raise UnfitError(f"{path}: there is no {name}: what stands before it is not a group of keys")
    entries, added = list(node.entries), Scalar(node.mark, name)
    for i, (known, value) in enumerate(entries):
        if known.text == name:
            entries[i] = (known, _put(value, rest, text, path))
            return Entries(node.mark, tuple(entries))
    empty: Node = Entries(node.mark, ()) if rest else Scalar(node.mark, "")
    return Entries(node.mark, (*entries, (added, _put(empty, rest, text, path))))
