"""Reads a journal back: every recorded decision of a bay, with its input, and the events it caused.

Theory of operation. File content is untrusted until it is decoded, and a power cut leaves torn lines: unreadable lines
are counted and skipped. Snapshots are differences, so a lost line invalidates its successors up to the next complete
one. Each run of the service starts over, and so does the monotonic clock after a reboot: an event belongs to the
decision within whose few milliseconds it was written, and if there are several, to the one with the same wall-clock
time.
"""

import json
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cattrs import Converter
from cattrs.errors import BaseValidationError

from orchestrator.config.station import BayConfig
from orchestrator.core.memory import Memory, in_parts
from orchestrator.core.rules import Rules
from orchestrator.errors import Finding
from orchestrator.model import Cause, Snapshot
from orchestrator.model.cause import from_plain
from orchestrator.service.parts import stream_of
from orchestrator.workbench.replay.files import files_of, lines_of

#: The records that `decision_lines` writes for a decision.
EVENTS = frozenset({"transition", "command", "fault", "session", "decision"})
#: Records that break continuity: another run of the service, lines that the disk did not take.
BREAKS = frozenset({"run", "lost"})
#: Why a recording cannot be repeated: it has sentences from an older version, and no causes.
SENTENCES = "an older version of this service has recorded this step: only that version can decide it again"
#: No decision takes longer than this to be recorded.
STEP_S = 60.0

Fields = dict[str, Any]
Event = tuple[str, Mapping[str, object]]  #: kind, fields

_CONVERTER = Converter(detailed_validation=False)
_CONVERTER.register_structure_hook(Path, lambda text, _: Path(text))
_CONVERTER.register_structure_hook(Cause, lambda value, _: from_plain(value))


class _OlderError(Exception):
    """A line with sentences where the core now has causes."""


@dataclass(slots=True)
class Recorded:
    """One recorded decision. `memory` and `rules` are present where the recording has a complete snapshot."""

    at_s: float  #: the time given to the decision
    wall: str  #: the same for people, RFC 3339
    snapshot: Snapshot
    memory: Memory | None = None
    rules: Rules | None = None
    events: list[Event] = field(default_factory=list)  #: its events in the journal
    written_s: float = 0.0  #: when it was recorded, right after its events
    gap: bool = False  #: decisions right before it are lost
    unsure: bool = False  #: some of its events may be lost


@dataclass(slots=True)
class Record:
    """Everything that could be read."""

    bays: dict[str, list[Recorded]] = field(default_factory=dict)  #: each bay's decisions, in order
    broken: list[Finding] = field(default_factory=list)  #: the unreadable lines


@dataclass(slots=True)
class _Stream:
    """The reading position in the files of one stream."""

    parts: dict[str, Fields] = field(default_factory=dict)  #: each bay's last snapshot
    gaps: set[str] = field(default_factory=set)  #: the bays that have lost decisions since then
    wall: str = ""  #: the time of the last line …
    hole: bool = False  #: … after which something is missing

    def stop(self) -> None:
        """Break continuity: the following lines do not continue the earlier ones."""
        self.gaps |= self.parts.keys()
        self.parts.clear()


class _Reader:
    """Reads the lines of all files, one after another."""

    def __init__(self) -> None:
        self.record = Record()
        self.events: list[Fields] = []
        self.holes: list[tuple[str, str]] = []  # wall-clock intervals in which something is missing
        self._streams: dict[str, _Stream] = {}
        self._stream = _Stream()

    def begin(self, path: Path) -> None:
        """Begin another file, which may continue an older one."""
        self._stream = self._streams.setdefault(str(path.parent / stream_of(path)), _Stream())

    def take(self, path: Path, number: int, text: bytes) -> None:
        """Process one line."""
        try:
            line = _line(text)
            if line["kind"] == "snapshot":
                self._snapshot(line)
        except _OlderError:
            self.broken(path, number, SENTENCES)
            return
        except (BaseValidationError, LookupError, TypeError, ValueError, RecursionError, OverflowError) as error:
            self.broken(path, number, f"this is no line of a journal: {error!r:.200}")
            return
        stream = self._stream
        if stream.hole:
            self.holes.append((stream.wall, line["wall"]))
        stream.wall, stream.hole = line["wall"], False
        if line["kind"] in BREAKS:
            stream.stop()
        elif line["kind"] in EVENTS:
            self.events.append(line)

    def broken(self, path: Path, number: int, text: str) -> None:
        """Record a skipped line; its content is unknown."""
        self.record.broken.append(Finding(str(path), number, 1, text))
        self._stream.hole = True
        self._stream.stop()

    def end(self) -> Record:
        """Everything read, with each event assigned to its decision."""
        self.holes += [(stream.wall, "") for stream in self._streams.values() if stream.hole]
        for step in (step for taken in self.record.bays.values() for step in taken):
            step.unsure = any(since <= step.wall and (not until or step.wall <= until) for since, until in self.holes)
        _spread(self.events, self.record.bays)
        return self.record

    def _snapshot(self, line: Fields) -> None:
        """A complete snapshot, or its differences from the previous one."""
        memory: Memory | None = None
        rules: Rules | None = None
        bay, at_s, parts = line["bay"], float(line["at_s"]), self._stream.parts
        if line.get("whole"):
            if "cause" not in line["memory"] or isinstance(line["charger_link"]["problem"], str):
                raise _OlderError
            plain = {name: line[name] for name in Snapshot.__slots__ if name in line}  # newer fields get their defaults
            memory = _CONVERTER.structure(in_parts(line["memory"]), Memory)
            if "chemistry" not in line["config"]["policy"]["pack"]:
                raise ValueError(
                    "its policy is of the first edition, which spoke of steps: replay it with that version"
                )
            rules = Rules.of(_CONVERTER.structure(line["config"], BayConfig))
        elif bay in parts:
            before = parts[bay]
            changed = {name: line[name] for name in Snapshot.__slots__ if name in line}
            plain = {**before, **changed, "battery": {**before["battery"], **changed.get("battery", {})}}
        else:
            return  # the snapshot that it continues is lost
        snapshot = _CONVERTER.structure(plain, Snapshot)
        recorded = Recorded(
            at_s, line["wall"], snapshot, memory, rules, written_s=line["t"], gap=bay in self._stream.gaps
        )
        self.record.bays.setdefault(bay, []).append(recorded)
        parts[bay] = plain
        self._stream.gaps.discard(bay)


def read(paths: Iterable[Path]) -> Record:
    """Each bay's decisions from journal directories and files (JSON Lines, also gzipped).

    Raises ConfigError for files that cannot be read at all.
    """
    reader = _Reader()
    for path in files_of(paths):
        reader.begin(path)
        for number, text in lines_of(path):
            if text is None:
                reader.broken(path, number, "something is torn here")
            else:
                reader.take(path, number, text)
    return reader.end()


def _line(text: bytes) -> Fields:
    """One line's object; ValueError for anything else."""
    line = json.loads(text)
    if not isinstance(line, dict) or not all(isinstance(line.get(key), str) for key in ("kind", "bay", "wall")):
        raise ValueError("it has t, wall, bay and kind")
    line["t"] = float(line["t"])
    return line


def _spread(events: Iterable[Fields], bays: Mapping[str, list[Recorded]]) -> None:
    """Assign each event to its decision; drop events whose decision is lost."""
    by_time = {bay: sorted(steps, key=lambda step: step.at_s) for bay, steps in bays.items()}
    times = {bay: [step.at_s for step in steps] for bay, steps in by_time.items()}
    for line in events:
        near = list(_near(line["t"], by_time.get(line["bay"], []), times.get(line["bay"], [])))
        if near:
            later = [step for step in near if step.wall >= line["wall"]]  # a decision is recorded after its events
            step = min(later or near, key=lambda step: step.wall)
            fields = {name: value for name, value in line.items() if name not in ("t", "wall", "bay", "kind")}
            step.events.append((line["kind"], fields))


def _near(t_s: float, steps: Sequence[Recorded], times: Sequence[float]) -> Iterator[Recorded]:
    """The decisions that an event of this time may belong to: one in each boot of the machine."""
    for at in range(bisect_right(times, t_s) - 1, -1, -1):
        if times[at] < t_s - STEP_S:
            return
        if t_s <= steps[at].written_s:
            yield steps[at]
