"""The five kinds of file, and finding one by path or by the name of a shipped file."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from orchestrator.config.map_rules import MAP_RULES
from orchestrator.config.policy import Policy
from orchestrator.config.policy_rules import policy_problems
from orchestrator.config.rules import Problems, problems
from orchestrator.config.shipped import shipped_dir, shipped_names
from orchestrator.config.station import Station
from orchestrator.config.station_rules import station_problems
from orchestrator.config.yaml.numbers import shown
from orchestrator.config.yaml.scalars import UnfitError, did_you_mean, nearest
from orchestrator.config.yaml.tree import Entries, Node
from orchestrator.protocol.objects import ObjectMap


@dataclass(frozen=True, slots=True)
class Content:
    """What a kind of file is read into, and its rules."""

    record: type
    rules: Callable[[Mapping[str, object]], Problems]


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of file: its name, which is its identifying key, the folder of shipped ones, and its content."""

    key: str
    about: str
    folder: str
    content: Callable[[], Content]
    known_by: str = ""  #: the identifying key, if it is another one

    @property
    def mark(self) -> str:
        """The key by which a file of this kind is known."""
        return self.known_by or self.key


def _scenario() -> Content:
    """Imported when a scenario is read: the service never reads one, and starts 10 ms earlier without it."""
    from orchestrator.config.scenario import Scenario  # noqa: PLC0415 - see above
    from orchestrator.config.scenario_rules import SCENARIO_RULES  # noqa: PLC0415 - see above

    return Content(Scenario, partial(problems, SCENARIO_RULES))


def _northbound() -> Content:
    """As above: the service never reads one."""
    from orchestrator.config.northbound import Northbound  # noqa: PLC0415 - see above
    from orchestrator.config.northbound_rules import northbound_problems  # noqa: PLC0415 - see above

    return Content(Northbound, northbound_problems)


def _users() -> Content:
    """As above."""
    from orchestrator.config.northbound import UsersFile  # noqa: PLC0415 - see above
    from orchestrator.config.northbound_rules import user_problems  # noqa: PLC0415 - see above

    return Content(UsersFile, user_problems)


POLICY = Kind("policy", "policy", "policies", lambda: Content(Policy, policy_problems))
MAP = Kind("map", "object map", "configs/maps", lambda: Content(ObjectMap, partial(problems, MAP_RULES)))
STATION = Kind("station", "station", "configs/stations", lambda: Content(Station, station_problems))
SCENARIO = Kind("scenario", "scenario", "configs/scenarios", _scenario)
#: It names its station under the key `station`, so it is looked for before stations are.
NORTHBOUND = Kind("northbound", "northbound file", "configs/northbound", _northbound, known_by="page")
#: In the order in which a file's keys are compared with theirs.
KINDS = (POLICY, MAP, NORTHBOUND, STATION, SCENARIO)
#: Written by `orchestrator user`, so it is none of the kinds that people write.
USERS = Kind("users", "file of users", "", _users)


@dataclass(frozen=True, slots=True)
class Place:
    """A file: its path, and its name in messages."""

    path: Path
    shown: str


def place(path: str | Path) -> Place:
    """A file as named by the user."""
    return Place(Path(path), str(path))


def find(kind: Kind, text: str, base: Path) -> Place:
    """The file named by `text`: a path relative to the directory `base`, or a shipped file's name.

    Raises `UnfitError` with the shipped names if there is no such file.
    """
    if "/" in text or text.endswith((".yaml", ".yml")):
        path = Path(os.path.normpath(base / text))
        try:
            if (base / text).exists():  # reading it reports what is not a regular file
                return Place(base / text, str(path))
        except OSError as error:  # e.g. the name is too long
            raise UnfitError(f"{shown(text)}: {error.strerror}") from None
        raise UnfitError(f"there is no file {path}{_instead(kind, path)}")
    names = shipped_names(kind.folder)
    if text in names:
        return Place(shipped_dir() / kind.folder / f"{text}.yaml", f"{kind.folder}/{text}.yaml")
    raise UnfitError(f"no {kind.about} of this name is shipped; {did_you_mean(text, names)}; or a path to a .yaml file")


def _instead(kind: Kind, path: Path) -> str:
    if path.stem in shipped_names(kind.folder):
        return f"; for the shipped {kind.about} write {path.stem}"
    return nearest_file(path)


def nearest_file(path: Path) -> str:
    """What the name of a missing file may have meant."""
    if not path.parent.is_dir():
        return f": there is no directory {path.parent}"
    near = nearest(path.name, sorted(other.name for other in path.parent.glob("*.y*ml")))
    return f"; did you mean {near}?" if near else ""


def kinds_of(node: Node | None) -> list[Kind]:
    """The kinds of file that this may be, by its keys."""
    keys = {name.text for name, _ in node.entries} if isinstance(node, Entries) else set()
    return [kind for kind in KINDS if kind.mark in keys]


def kind_near(key: str) -> str:
    """The mark of a kind that is spelled nearly so; "" if there is none."""
    return nearest(key, [kind.mark for kind in KINDS])
