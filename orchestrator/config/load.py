"""Loads what is in a file of one of our kinds, or reports every finding in it at once."""

import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from orchestrator.config.change import changed
from orchestrator.config.files import (
    KINDS,
    MAP,
    NORTHBOUND,
    POLICY,
    SCENARIO,
    STATION,
    USERS,
    Kind,
    Place,
    find,
    kind_near,
    kinds_of,
    nearest_file,
    place,
)
from orchestrator.config.plainfile import read_plain
from orchestrator.config.policy import Policy
from orchestrator.config.rules import Problems
from orchestrator.config.station import Station
from orchestrator.config.stationsteps import Steps, bay_count, named_steps
from orchestrator.config.yaml.reader import Reader
from orchestrator.config.yaml.scalars import UnfitError
from orchestrator.config.yaml.schema import INVALID
from orchestrator.config.yaml.tree import MAX_BYTES, Entries, Node, Refused, parse
from orchestrator.config.yesterday import Yesterday
from orchestrator.errors import ConfigError, Finding
from orchestrator.keys import Source
from orchestrator.protocol.objects import ObjectMap

if TYPE_CHECKING:
    from orchestrator.config.northbound import Northbound, UsersFile
    from orchestrator.config.scenario import Scenario

T = TypeVar("T")
#: A file's values by path, and the lines of the keys that it has → what is probably unintended.
Lint = Callable[[Mapping[str, object], Source], Problems]
#: The kind of file expected wherever one is named.
OURS = "a YAML file: a station, a policy, an object map, a scenario or a northbound file"


def load_station(path: str | Path) -> Station:
    """The station in a file, with its policies and object maps. Raises `ConfigError`."""
    return _load(STATION, place(path), Station)


def load_policy(
    name_or_path: str | Path, relative_to: Path | None = None, changes: Mapping[str, str] | None = None
) -> Policy:
    """A policy by a shipped name or a path (relative to the directory `relative_to`). Raises `ConfigError`.

    `changes` replace values in the file, by dotted path: `{"current.soc_pct[0].to": "80"}`.
    """
    return _load(POLICY, _find(POLICY, name_or_path, relative_to), Policy, changes or {})


def load_map(name_or_path: str | Path, relative_to: Path | None = None) -> ObjectMap:
    """An object map by a shipped name or a path (relative to the directory `relative_to`). Raises `ConfigError`."""
    return _load(MAP, _find(MAP, name_or_path, relative_to), ObjectMap)


def load_scenario(name_or_path: str | Path) -> "Scenario":
    """A scenario by a shipped name or a path. Raises `ConfigError`."""
    from orchestrator.config.scenario import Scenario  # noqa: PLC0415 - as in `files.py`

    return _load(SCENARIO, _find(SCENARIO, name_or_path, None), Scenario)


def load_northbound(path: str | Path) -> "Northbound":
    """The northbound file at a path. Raises `ConfigError`."""
    from orchestrator.config.northbound import Northbound  # noqa: PLC0415 - as in `files.py`

    return _load(NORTHBOUND, place(path), Northbound)


def load_users(path: str | Path) -> "UsersFile":
    """The users in a file. Raises `ConfigError`."""
    from orchestrator.config.northbound import UsersFile  # noqa: PLC0415 - as in `files.py`

    return _load(USERS, place(path), UsersFile)


@dataclass(frozen=True, slots=True)
class Checked:
    """What `examine` looked at, and found."""

    findings: list[Finding]
    looked_at: Mapping[str, int]  #: bays, and files by the key of their kind; maps only if they were named


def check(paths: Iterable[str | Path], lint: Mapping[str, Lint] | None = None) -> list[Finding]:
    """The findings of `examine`."""
    return examine(paths, lint).findings


def examine(paths: Iterable[str | Path], lint: Mapping[str, Lint] | None = None) -> Checked:
    """Everything wrong in these files and in the files that they name, sorted. Without an error the answer is yes.

    A file's kind is identified by its key `policy`, `map`, `page`, `station` or `scenario`. A file named twice is
    reported once. `lint`, by that key, adds warnings about files without errors.
    """
    places = [place(path) for path in paths]
    loader = _Loader(places, lint=lint)
    for one in places:
        loader.check(one)
    return Checked(sorted(set(loader.findings)), loader.looked_at)


def _load(kind: Kind, where: Place, wanted: type[T], changes: Mapping[str, str] | None = None) -> T:
    loader = _Loader([where], changes or {})
    value: object = INVALID
    try:
        value = loader.load(kind, where)
    except UnfitError as error:
        loader.findings.append(Finding(where.shown, 1, 1, str(error)))
    if loader.findings or not isinstance(value, wanted):
        raise ConfigError(tuple(sorted(set(loader.findings))))
    return value


def _find(kind: Kind, name_or_path: str | Path, relative_to: Path | None) -> Place:
    try:
        if isinstance(name_or_path, Path):
            return place(relative_to / name_or_path if relative_to else name_or_path)
        return find(kind, name_or_path, relative_to or Path())
    except UnfitError as error:
        raise ConfigError((Finding(str(name_or_path), 1, 1, str(error)),)) from None


class _Loader:
    """Reads each file once, however many bays name it, and collects all findings."""

    def __init__(
        self,
        named: Iterable[Place],
        changes: Mapping[str, str] | None = None,
        lint: Mapping[str, Lint] | None = None,
    ) -> None:
        self.findings: list[Finding] = []
        self.looked_at: Counter[str] = Counter()
        self._lint = lint or {}
        self._changes = changes or {}
        self._shown = {os.path.realpath(one.path): one.shown for one in named}
        self._named = frozenset(self._shown)
        self._trees: dict[str, Node | None] = {}
        self._digests: dict[str, str] = {}
        self._loaded: dict[tuple[str, str], object] = {}
        self._steps_a: dict[str, Steps] = {}  # by policy file: the steps of the chargers that use it

    def check(self, where: Place) -> None:
        """Read a file whose kind its own key identifies."""
        node = self._tree(where)
        if node is None or isinstance(node, Refused):
            return
        if kinds := kinds_of(node):
            self._check_shown(where, self.load(kinds[0], where))
            return
        keys = [name.text for name, _ in node.entries] if isinstance(node, Entries) else []
        near = next((f" ({key!r}: did you mean {found}?)" for key in keys if (found := kind_near(key))), "")
        marks = ", ".join(kind.mark for kind in KINDS)
        text = f"this is no file of ours: it has none of the keys {marks}{near}"
        self.findings.append(Finding(self._name(where), node.mark.line, node.mark.column, text))

    def _check_shown(self, where: Place, value: object) -> None:
        """The station that a northbound file shows: serving it does not need all of it, whoever checks it does."""
        station, source = getattr(value, "station", None), getattr(value, "source", None)
        if not isinstance(station, Path) or not isinstance(source, Source):
            return
        try:
            self.load(STATION, place(station))
        except UnfitError as error:
            self.findings.append(Finding(self._name(where), source.lines.get("station", 1), 1, f"station: {error}"))

    def load(self, kind: Kind, where: Place) -> object:
        """The record in a file, or `INVALID` if anything in it, or in a file that it names, is wrong.

        Raises `UnfitError` if the file is of another kind, or if a change does not apply to it.
        """
        real = (os.path.realpath(where.path), kind.key)
        if real not in self._loaded:
            node = self._tree(where)
            others = kinds_of(node)
            if others and kind not in others:
                text = (
                    f"{self._name(where)} has the key {others[0].mark!r}; needed is a file with the key {kind.mark!r}"
                )
                raise UnfitError(text)
            self._loaded[real] = self._read(kind, where, changed(node, self._changes) if node else None)
        return self._loaded[real]

    def _read(self, kind: Kind, where: Place, node: Node | None) -> object:
        if node is None or isinstance(node, Refused):
            return INVALID
        base, real = where.path.parent, os.path.realpath(where.path)
        # Many bays name the same files: each name is looked for once.
        named: dict[type, Callable[[str], object]] = {
            Policy: cache(lambda text: self.load(POLICY, find(POLICY, text, base))),
            ObjectMap: cache(lambda text: self.load(MAP, find(MAP, text, base))),
        }
        self._count(kind, real, node)
        if kind is STATION:
            self._steps_a.update(named_steps(node, base))
        yesterday = Yesterday(node, self._steps_a.get(real, ())) if kind is POLICY else None
        reader = Reader(self._name(where), named if kind is STATION else {}, self._digests[real], yesterday)
        content = kind.content()
        value = reader.read(content.record, node)
        for path, text in content.rules(reader.values):
            reader.report(path, text)
        bad = bool(reader.findings)
        if not bad and kind.key in self._lint:
            for path, text in self._lint[kind.key](reader.values, Source(self._name(where), reader.lines)):
                reader.report(path, text, "warning")
        self.findings += reader.findings
        return INVALID if bad else value

    def _count(self, kind: Kind, real: str, node: Node) -> None:
        if kind is STATION:
            self.looked_at["bay"] += bay_count(node)
        elif kind is not MAP or real in self._named:  # a station names its maps in passing
            self.looked_at[kind.key] += 1

    def _tree(self, where: Place) -> Node | None:
        real = os.path.realpath(where.path)
        if real not in self._trees:
            try:
                text = read_plain(where.path, MAX_BYTES, OURS)
                self._digests[real] = sha256(text).hexdigest()
                node, findings = parse(self._name(where), text)
            except OSError as error:
                near = nearest_file(where.path) if isinstance(error, FileNotFoundError) else ""
                why = f"cannot be read: {error.strerror}{near}"
                node, findings = None, [Finding(self._name(where), 1, 1, why)]
            self.findings += findings
            self._trees[real] = node
        return self._trees[real]

    def _name(self, where: Place) -> str:
        return self._shown.setdefault(os.path.realpath(where.path), where.shown)
