"""Parses YAML text into a tree of nodes with positions: the small, unambiguous subset that a configuration needs.

Nothing is resolved or constructed here. A scalar keeps its text; the type that its key expects (`scalars.py`) gives it
its meaning, so that `on`, `1:30` or `012` cannot turn into something else on the way. Anchors, aliases, tags, merge
keys, duplicate keys and further documents are findings. Input is bounded in size, depth and count.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from orchestrator.config.yaml.errors import explain
from orchestrator.errors import Finding

MAX_BYTES = 512 * 1024  #: 128 bays with comments are about 80 KiB
MAX_DEPTH = 16  #: the deepest key of any of our files is at 7
MAX_NODES = 50_000  #: 128 bays are about 6 000
MAX_KEY = 128  #: characters
MAX_FINDINGS = 50  #: per file, so that a binary file does not fill the screen

#: libyaml is ten times as fast; what it rejects is parsed again by the pure parser, whose messages we translate.
_LOADERS: tuple[Any, ...] = (*((yaml.CSafeLoader,) if yaml.__with_libyaml__ else ()), yaml.SafeLoader)


@dataclass(frozen=True, slots=True, order=True)
class Mark:
    """A position in a file; line and column count from 1."""

    line: int
    column: int


@dataclass(frozen=True, slots=True)
class Scalar:
    """One value as written. `plain`: without quotes."""

    mark: Mark
    text: str
    plain: bool = True


@dataclass(frozen=True, slots=True)
class Items:
    """A list."""

    mark: Mark
    items: "tuple[Node, ...]"


@dataclass(frozen=True, slots=True)
class Entries:
    """A mapping; no key comes twice."""

    mark: Mark
    entries: "tuple[tuple[Scalar, Node], ...]"


@dataclass(frozen=True, slots=True)
class Refused:
    """Stands in for something that is already a finding."""

    mark: Mark


Node = Scalar | Items | Entries | Refused


def parse(file: str, data: bytes) -> tuple[Node | None, list[Finding]]:
    """The tree of `data`, and everything wrong with it as YAML; no tree if it cannot be parsed to the end."""
    if len(data) > MAX_BYTES:
        text = f"the file has more than {MAX_BYTES} bytes: this is not one of our files"
        return None, [Finding(file, 1, 1, text)]
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        column = error.start - before.rfind(b"\n")
        found = f"byte 0x{data[error.start]:02X} is not UTF-8: save the file with the encoding UTF-8"
        return None, [Finding(file, before.count(b"\n") + 1, column, found)]
    if findings := list(_unfit_characters(file, text)):
        return None, findings[:MAX_FINDINGS]
    return _compose(file, text)


_CHARACTERS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"^[^#\"'\t]*(\t)"), "a tab: use spaces"),
    (re.compile(r"^[^#\"'\xa0]*(\xa0)"), "a no-break space (U+00A0), perhaps from copying: use a plain space"),
    (re.compile("([\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff])"), "a control character: remove it"),
)


def _unfit_characters(file: str, text: str) -> Iterator[Finding]:
    """Characters that an editor shows as a blank, or not at all, and that trip up YAML or a person."""
    for number, line in enumerate(text.split("\n"), start=1):
        for pattern, problem in _CHARACTERS:
            if match := pattern.search(line.removesuffix("\r")):
                shown = "" if match[1] in "\t\xa0" else f" (U+{ord(match[1]):04X})"
                yield Finding(file, number, match.start(1) + 1, problem + shown)


def _compose(file: str, text: str) -> tuple[Node | None, list[Finding]]:
    failed: list[Finding] = []
    for loader in _LOADERS:
        composer = _Composer(file)
        try:
            for event in yaml.parse(text, Loader=loader):
                composer.take(event)
        except yaml.MarkedYAMLError as error:
            line, column, problem = explain(error)
            failed = [*composer.findings, Finding(file, line, column, problem)]
        except (ValueError, OverflowError):  # raised by the pure parser for an escape or a %YAML number out of range
            failed = failed or [Finding(file, 1, 1, "an escape, or the number behind %YAML, is beyond all bounds")]
        except _TooMuchError:
            return None, composer.findings
        else:
            if composer.root is None:
                composer.refuse(Mark(1, 1), "the file is empty")
            return composer.root, composer.findings
    return None, failed


class _TooMuchError(Exception):
    """Parsing further is pointless; the reason is already a finding."""


class _Composer:
    """Builds the tree from parser events, without recursion and without resolving anything."""

    def __init__(self, file: str) -> None:
        self.root: Node | None = None
        self.findings: list[Finding] = []
        self._file = file
        self._open: list[tuple[Mark, bool, list[Node]]] = []  # mark, whether tagged, children so far
        self._count = 0

    def refuse(self, mark: Mark, text: str) -> None:
        self.findings.append(Finding(self._file, mark.line, mark.column, text))
        if len(self.findings) >= MAX_FINDINGS:
            raise _TooMuchError

    def take(self, event: yaml.Event) -> None:
        start = event.start_mark
        mark = Mark(start.line + 1, start.column + 1) if start else Mark(1, 1)
        if isinstance(event, yaml.NodeEvent):
            self._begin(event, mark)
        elif isinstance(event, yaml.CollectionEndEvent):
            began, tagged, children = self._open.pop()
            items = isinstance(event, yaml.SequenceEndEvent)
            node = Items(began, tuple(children)) if items else Entries(began, tuple(self._pairs(children)))
            self._add(Refused(began) if tagged else node)
        elif isinstance(event, yaml.DocumentStartEvent) and self.root is not None:
            self.refuse(mark, "a second document begins here (---): one file holds one document")
            raise _TooMuchError

    def _begin(self, event: yaml.NodeEvent, mark: Mark) -> None:
        self._count += 1
        if self._count > MAX_NODES or len(self._open) >= MAX_DEPTH:
            what = f"more than {MAX_NODES} values" if self._count > MAX_NODES else f"nested more than {MAX_DEPTH} deep"
            self.refuse(mark, f"{what}: this is not one of our files")
            raise _TooMuchError
        if isinstance(event, yaml.AliasEvent):
            self.refuse(mark, f"alias *{event.anchor}: anchors and aliases are not allowed, write the value out")
            self._add(Refused(mark))
            return
        if event.anchor is not None:
            self.refuse(mark, f"anchor &{event.anchor}: anchors and aliases are not allowed, remove it")
        tag: str | None = event.tag  # type: ignore[attr-defined]  # every node event but an alias has one
        if tag is not None:
            self.refuse(mark, f"tag {tag.replace('tag:yaml.org,2002:', '!!')}: tags are not allowed, remove it")
        if isinstance(event, yaml.ScalarEvent):
            self._add(Scalar(mark, event.value, not event.style) if tag is None else Refused(mark))
        else:
            self._open.append((mark, tag is not None, []))

    def _add(self, node: Node) -> None:
        if self._open:
            self._open[-1][2].append(node)
        else:
            self.root = node

    def _pairs(self, children: list[Node]) -> list[tuple[Scalar, Node]]:
        seen: dict[str, Mark] = {}
        pairs: list[tuple[Scalar, Node]] = []
        before: Node | None = None
        for name, value in zip(children[::2], children[1::2], strict=True):
            if not isinstance(name, Scalar):
                if not isinstance(name, Refused):
                    self.refuse(name.mark, "a list or a mapping cannot be a key")
            elif problem := _decimal_comma(before, name):
                self.refuse(name.mark, problem)
                if pairs and pairs[-1][1] is before:  # 14 of {max_a: 14,5} is not what was meant
                    pairs[-1] = (pairs[-1][0], Refused(pairs[-1][1].mark))
            elif problem := _unfit_key(name):
                self.refuse(name.mark, problem)
            elif name.text in seen:
                first = seen[name.text]
                self.refuse(name.mark, f"{name.text!r} again: it stands already in line {first.line}; remove one")
            else:
                seen[name.text] = name.mark
                pairs.append((name, value))
            before = value
        return pairs


_COMMA = re.compile(r"[-+]?\d+,\d+", re.ASCII)
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}", re.ASCII)
_NUMERIC = re.compile(r"[-+]?\d+(\.\d+)?", re.ASCII)
_NOT_TEXT = re.compile(r"~|null|true|false|yes|no|on|off|y|n|[-+]?[.\d][\d_.,:]*(e[-+]?\d+)?|0x[\da-f]+", re.IGNORECASE)


def _decimal_comma(before: Node | None, name: Scalar) -> str:
    """What to write for `{max_a: 8,5}`, where 5 is read as the next key; "" if this is something else."""
    if not isinstance(before, Scalar) or not (before.plain and name.plain) or before.mark.line != name.mark.line:
        return ""
    parts = f"{before.text},{name.text}"
    if not _COMMA.fullmatch(parts):
        return ""
    thousands = f"; if thousands are meant, {before.text}{name.text}" if _THOUSANDS.fullmatch(parts) else ""
    return f"use a decimal point: {parts.replace(',', '.')}, not {parts}{thousands}"


def _unfit_key(name: Scalar) -> str:
    """Why this scalar cannot be a key; "" if it can."""
    if name.plain and name.text == "<<":
        return "merge key <<: not allowed, write the keys out"
    if not name.text:
        return "a key is missing before ':'"
    if len(name.text) > MAX_KEY or not name.text.isprintable():
        return f"a key is one line of at most {MAX_KEY} characters, without control characters"
    if name.plain and _NUMERIC.fullmatch(name.text):
        return f"a number, {name.text}, where a key is needed: several numbers stand in brackets, [1.5, 2]"
    if name.plain and _NOT_TEXT.fullmatch(name.text):
        return f"the key {name.text} is not a word in YAML: use a name, or put it in quotes"
    return ""
