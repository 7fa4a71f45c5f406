"""A YAML tree into the frozen dataclasses that describe it, by their type hints and `keys.Key`.

One generic walk for every file that we have. It never stops at an error: whatever is wrong becomes a finding, what is
right is kept in `values` by its dotted path, so that the rules across keys (`rules.py`) can run on the rest.
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from orchestrator.config.yaml import scalars
from orchestrator.config.yaml.numbers import decimals_meant, range_meant
from orchestrator.config.yaml.scalars import UnfitError
from orchestrator.config.yaml.schema import INVALID, Slot, join, slots, told_keys
from orchestrator.config.yaml.tree import Entries, Items, Mark, Node, Refused, Scalar
from orchestrator.config.yaml.unknown import unknown_key
from orchestrator.config.yesterday import ROWS, Yesterday
from orchestrator.errors import Finding
from orchestrator.keys import KeyRule, Range, Source

MAX_FINDINGS = 200  #: in one file; the rest can wait until these are mended

_SCALARS: dict[object, Callable[..., object]] = {
    float: scalars.read_float,
    int: scalars.read_int,
    bool: scalars.read_bool,
    str: scalars.read_str,
    object: scalars.read_any,
}


class Reader:
    """Reads one file's tree. `findings`, `values`, `marks` and `lines` fill while it goes.

    `references`: for types that are named in the file but described in another one, how to get them; these return
    `INVALID` when they have reported a finding elsewhere and raise `UnfitError` for one at the name itself.
    """

    def __init__(
        self,
        file: str,
        references: Mapping[type, Callable[[str], object]] | None = None,
        digest: str = "",
        yesterday: Yesterday | None = None,
    ) -> None:
        self.findings: list[Finding] = []
        self.values: dict[str, object] = {}
        self.marks: dict[str, Mark] = {}
        self.lines: dict[str, int] = {}
        self._file, self._digest = file, digest
        self._references = references or {}
        self._yesterday = yesterday or Yesterday()

    def report(self, path: str, text: str, severity: str = "error") -> None:
        """A finding at the key `path`, or at its nearest parent that is written in the file."""
        at = path
        while at not in self.marks and at:
            at = _parent(at)
        self._report(self.marks.get(at, Mark(1, 1)), f"{path}: {text}" if path else text, severity)

    def read(self, record: type, node: Node) -> object:
        """The whole file as one record, or `INVALID`."""
        self.marks[""] = node.mark
        return self._record(node, record, "")

    def _report(self, mark: Mark, text: str, severity: str = "error") -> None:
        if len(self.findings) < MAX_FINDINGS:
            self.findings.append(Finding(self._file, mark.line, mark.column, text, severity))

    # --- by kind of type -------------------------------------------------------------------------------------------

    def _value(self, node: Node, hint: Any, path: str, key: KeyRule) -> object:  # noqa: ANN401 - any type expression
        value: object
        if get_origin(hint) in (Union, UnionType):
            if scalars.is_null(node):
                value = None
            else:
                (hint,) = (arg for arg in get_args(hint) if arg is not NoneType)
                value = self._value(node, hint, path, key)
        elif isinstance(node, Refused):
            value = INVALID
        elif hint is object and not isinstance(node, Scalar):
            value = self._as_it_is(node, path, key)
        elif hint is Range:
            value = self._range(node, path, key)
        elif isinstance(hint, type) and is_dataclass(hint) and hint not in self._references:
            value = self._record(node, hint, path)
        elif get_origin(hint) is tuple:
            value = self._items(node, get_args(hint)[0], path, key)
        elif get_origin(hint) is Mapping:
            value = self._mapping(node, get_args(hint)[1], path, key)
        else:
            value = self._scalar(node, hint, path, key)
        if value is not INVALID:
            self.values[path] = value
        return value

    def _scalar(self, node: Node, hint: Any, path: str, key: KeyRule) -> object:  # noqa: ANN401 - any type expression
        if not isinstance(node, Scalar):
            self._report(node.mark, f"{path}: needs one value here, not {_kind(node)}: {key.about}")
            return INVALID
        try:
            if node.plain and not node.text:
                raise UnfitError(f"needs a value: {key.about}")
            if scalars.is_null(node) and hint is not object:
                raise UnfitError(f"cannot be null: {key.about}")
            if hint in self._references:
                return self._references[hint](scalars.read_path(node, key))
            if hint is Path or key.is_path:
                return hint(Path(self._file).parent / scalars.read_path(node, key))
            if isinstance(hint, type) and issubclass(hint, Enum):
                return scalars.read_enum(node, hint)
            return _SCALARS[hint](node, key)
        except UnfitError as error:
            self.report(path, str(error))
            return INVALID

    def _range(self, node: Node, path: str, key: KeyRule) -> object:
        if not isinstance(node, Items) or len(node.items) != 2:
            meant, much = range_meant(node)
            self.report(path, f"write {meant or '[low, high]'}{much}: {key.about}")
            return INVALID
        low, high = (self._element(item, float, f"{path}[{i}]", key) for i, item in enumerate(node.items))
        if not (isinstance(low, float) and isinstance(high, float)):
            return INVALID
        if low < high:
            return Range(low, high)
        self._report(node.mark, f"{path}: [low, high] with low below high, not [{low:g}, {high:g}]")
        return INVALID

    def _items(self, node: Node, hint: Any, path: str, key: KeyRule) -> object:  # noqa: ANN401 - any type expression
        if not isinstance(node, Items):
            self.report(path, f"needs a list, [a, b, …] or a line '- …' for each item: {key.about}")
            return INVALID
        if not node.items:
            self.report(path, f"needs at least one item: {key.about}")
            return INVALID
        if hint is float and (meant := decimals_meant(node)):
            self.report(path, f"a decimal has a point, not a comma: write {meant}")
            return INVALID
        values = tuple(self._element(item, hint, f"{path}[{i}]", key) for i, item in enumerate(node.items))
        return INVALID if INVALID in values else values

    def _as_it_is(self, node: Items | Entries, path: str, key: KeyRule) -> object:
        """A list or a mapping for a library that is handed it as it is, whatever is in it."""
        if isinstance(node, Items):
            items = [self._element(item, object, f"{path}[{i}]", key) for i, item in enumerate(node.items)]
            return INVALID if INVALID in items else items
        values = {
            name.text: self._entry(name, value, object, f"{path}.{name.text}", key) for name, value in node.entries
        }
        return INVALID if INVALID in values.values() else values

    def _element(self, node: Node, hint: Any, path: str, key: KeyRule) -> object:  # noqa: ANN401 - any type expression
        self.marks[path] = node.mark
        self.lines[path] = node.mark.line
        return self._value(node, hint, path, key)

    def _mapping(self, node: Node, hint: Any, path: str, key: KeyRule) -> object:  # noqa: ANN401 - any type expression
        if not isinstance(node, Entries) or not node.entries:
            self.report(path, f"needs names with their values, indented below it: {key.about}")
            return INVALID
        values = {}
        for name, value in node.entries:
            values[name.text] = self._entry(name, value, hint, f"{path}.{name.text}", key)
        return INVALID if INVALID in values.values() else values

    def _entry(self, name: Scalar, node: Node, hint: Any, path: str, key: KeyRule) -> object:  # noqa: ANN401 - as above
        self.marks[path] = node.mark if node.mark.line == name.mark.line and not _empty(node) else name.mark
        self.lines[path] = name.mark.line
        return self._value(node, hint, path, key)

    # --- records ---------------------------------------------------------------------------------------------------

    def _record(self, node: Node, record: type, path: str) -> object:
        known = slots(record)
        if isinstance(node, Items) and "rows" in known:
            self.report(path, ROWS.format(name=path.rpartition(".")[2]))
            rows = known["rows"]
            self._items(node, get_args(rows.hint)[0], join(path, rows.name), rows.key)
            return INVALID
        if not isinstance(node, Entries):
            self.report(path, f"needs {told_keys(known.values())}, indented below it")
            return INVALID
        given = {name.text for name, _ in node.entries}
        values: dict[str, object] = {}
        for name, value in node.entries:
            slot = known.get(name.text) or self._other(name, value, record, given | set(values), path)
            if slot is not None:
                values[slot.name] = self._entry(name, value, slot.hint, join(path, slot.name), slot.key)
        for slot in known.values():
            if slot.name not in values:
                values[slot.name] = self._absent(slot, record, path)
        if INVALID in values.values():
            return INVALID
        return self._build(record, {known[name].field: value for name, value in values.items()}, path)

    def _other(self, name: Scalar, node: Node, record: type, taken: set[str], path: str) -> Slot | None:
        """A key that is none of this record's: one of yesterday, or unknown."""
        if instead := self._yesterday.instead(record, name.text, node):
            self._report(name.mark, f"{join(path, name.text)}: {instead}")
            return None
        return self._unknown(name, record, taken, path)

    def _unknown(self, name: Scalar, record: type, taken: set[str], path: str) -> Slot | None:
        """Says what an unknown key may have meant; if that is still free, its value is read as such."""
        guess = len(self.findings) < MAX_FINDINGS  # a guess takes its time, and nobody would read it any more
        meant = unknown_key(name.text, record, frozenset(self._references), guess=guess)
        at = f" in {path}" if path else ""
        self._report(name.mark, f"unknown key {name.text!r}{at}; {meant.hint}")
        return meant.slot if meant.slot is not None and meant.slot.name not in taken else None

    def _absent(self, slot: Slot, record: type, path: str) -> object:
        if slot.default is INVALID:
            about = f"{slot.key.about}, in {slot.key.unit}" if slot.key.unit else slot.key.about
            write = self._yesterday.missing(record, slot.name, self.values)
            self.report(path, f"the key {slot.name!r} is missing: {about}{'; ' if write else ''}{write}")
        else:
            self._default(slot.default, join(path, slot.name))
        return slot.default

    def _default(self, value: object, path: str) -> None:
        self.values[path] = value
        if is_dataclass(value) and not isinstance(value, (type, Range)):
            for slot in slots(type(value)).values():
                self._default(getattr(value, slot.field), join(path, slot.name))

    def _build(self, record: type, values: dict[str, object], path: str) -> object:
        if any(field.name == "source" for field in dataclasses.fields(record)):
            prefix = f"{path}." if path else ""
            lines = {at.removeprefix(prefix): line for at, line in self.lines.items() if at.startswith(prefix)}
            values["source"] = Source(self._file, lines, self._digest)
        return record(**values)


def _parent(path: str) -> str:
    return path[: max(path.rfind("."), path.rfind("["), 0)]


def _empty(node: Node) -> bool:
    return isinstance(node, Scalar) and node.plain and not node.text


def _kind(node: Node) -> str:
    return "a list" if isinstance(node, Items) else "a group of keys"
