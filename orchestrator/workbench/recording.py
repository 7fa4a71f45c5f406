"""A journal read back: every step that was recorded of a bay, with all that it was given, and what was said of it.

What stands in a file is hostile until it is decoded: a line that is no snapshot of ours is named with its place.
"""

import gzip
import json
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cattrs import Converter
from cattrs.errors import BaseValidationError

from orchestrator.config.station import Bay
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.errors import ConfigError, Finding
from orchestrator.model import Snapshot

#: What `decision_lines` writes of a step.
EVENTS = frozenset({"transition", "command", "fault", "session", "decision"})
STREAMS = ("events", "snapshots")

Fields = dict[str, Any]
Event = tuple[str, Mapping[str, object]]  #: kind, fields

_CONVERTER = Converter(detailed_validation=False)
_CONVERTER.register_structure_hook(Path, lambda text, _: Path(text))


@dataclass(slots=True)
class Recorded:
    """One step as it was taken. `memory` and `rules` are there where the record begins anew."""

    at_s: float  #: the time that the step was given
    wall: str  #: the same for people, RFC 3339
    snapshot: Snapshot
    memory: Memory | None = None
    rules: Rules | None = None
    events: list[Event] = field(default_factory=list)  #: what the journal says of it


def read(paths: Iterable[Path]) -> dict[str, list[Recorded]]:
    """Each bay's steps, in order, from journal directories and files (JSON Lines, also gzipped).

    Raises ConfigError for what cannot be read, with file and line.
    """
    steps: dict[str, list[Recorded]] = {}
    events: list[Fields] = []
    parts: dict[str, Fields] = {}
    for path in _files(paths):
        for number, line in _lines(path):
            if line["kind"] == "snapshot":
                try:
                    _take(line, steps.setdefault(line["bay"], []), parts)
                except (BaseValidationError, LookupError, TypeError, ValueError) as error:
                    raise _wrong(path, number, f"this is no snapshot that can be read: {error!r}") from None
            elif line["kind"] in EVENTS:
                events.append(line)
    _spread(events, steps)
    return {bay: taken for bay, taken in steps.items() if taken}


def _files(paths: Iterable[Path]) -> list[Path]:
    """Files, and of directories their streams; the oldest first."""
    found: list[Path] = []
    for path in paths:
        inside = [one for name in STREAMS for one in path.glob(f"{name}*.jsonl*")] if path.is_dir() else [path]
        if not inside:
            raise _wrong(path, 1, "there is no journal here: events.jsonl and snapshots.jsonl")
        found += inside
    return sorted(found, key=_age, reverse=True)


def _age(path: Path) -> int:
    """`NAME.jsonl` is the newest, `NAME.7.jsonl` the oldest."""
    age = path.name.partition(".")[2].partition(".")[0]
    return int(age) if age.isdigit() else 0


def _lines(path: Path) -> Iterator[tuple[int, Fields]]:
    try:
        with (gzip.open if path.suffix == ".gz" else open)(path, "rb") as file:
            for number, text in enumerate(file, 1):
                line = _line(path, number, text)
                if line:
                    yield number, line
    except (OSError, EOFError) as error:
        raise _wrong(path, 1, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None


def _line(path: Path, number: int, text: bytes) -> Fields:
    """One line's object; empty for the last line of a journal that a power failure has cut off."""
    try:
        line = json.loads(text)
    except (ValueError, RecursionError):
        if text.endswith(b"\n") and text.strip():
            raise _wrong(path, number, "this is no JSON; a journal has one object a line") from None
        return {}
    if not isinstance(line, dict) or not all(isinstance(line.get(key), str) for key in ("kind", "bay", "wall")):
        raise _wrong(path, number, "this is no line of a journal: it has t, wall, bay and kind")
    return line


def _take(line: Fields, steps: list[Recorded], parts: dict[str, Fields]) -> None:
    """One snapshot line: a whole one, or what differs from the one before."""
    memory: Memory | None = None
    rules: Rules | None = None
    if line.get("whole"):
        plain = {name: line[name] for name in Snapshot.__slots__ if name in line}  # what is newer has its default
        memory = _CONVERTER.structure(line["memory"], Memory)
        rules = Rules.of(_CONVERTER.structure(line["config"], Bay))
    elif line["bay"] in parts:
        before = parts[line["bay"]]
        changed = {name: line[name] for name in Snapshot.__slots__ if name in line}
        plain = {**before, **changed, "battery": {**before["battery"], **changed.get("battery", {})}}
    else:
        return  # the file that it continues has gone
    parts[line["bay"]] = plain
    steps.append(Recorded(float(line["at_s"]), line["wall"], _CONVERTER.structure(plain, Snapshot), memory, rules))


def _spread(events: Iterable[Fields], steps: Mapping[str, list[Recorded]]) -> None:
    """Give each event to the step that it was written for: the last one begun before it."""
    times = {bay: [step.at_s for step in taken] for bay, taken in steps.items()}
    for line in events:
        at = bisect_right(times.get(line["bay"], []), line["t"]) - 1
        if at >= 0:
            fields = {name: value for name, value in line.items() if name not in ("t", "wall", "bay", "kind")}
            steps[line["bay"]][at].events.append((line["kind"], fields))


def _wrong(path: Path, number: int, text: str) -> ConfigError:
    return ConfigError((Finding(str(path), number, 1, text),))
