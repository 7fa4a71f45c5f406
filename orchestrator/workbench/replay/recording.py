"""Reads a journal back: every recorded decision of a bay, with its input, and the events it caused.

Theory of operation. File content is untrusted until it is decoded, and a power cut leaves torn lines: unreadable lines
are counted and passed over. A snapshot continues the one before it, so a lost line invalidates its successors up to the
next complete one. Each run of the service starts over, and so does the monotonic clock after a reboot. However long the
journal is, only the latest snapshot of each bay is in memory.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.errors import Finding
from orchestrator.model import Snapshot
from orchestrator.record.utc import unix_s, utc
from orchestrator.service.journal_files import (
    STREAMS,
    Fields,
    files_of,
    from_part,
    journals_of,
    lines_of,
    records_of,
    unreadable,
)
from orchestrator.service.parts import stream_of
from orchestrator.service.records import WHOLE_S
from orchestrator.workbench.replay.converting import SENTENCES, UNREADABLE, OlderError, snapshot_of, whole
from orchestrator.workbench.replay.events import Event, Events, run_of
from orchestrator.workbench.replay.rows import rows_of

#: Records that break continuity: another run of the service, lines that the disk did not take.
BREAKS = frozenset({"run", "lost"})
#: Complete snapshots may come this much later than they are due.
SLACK_S = 60.0
#: A snapshot's bay: it is found without decoding the line.
_BAY = re.compile(rb'"bay":"((?:[^"\\]|\\.)*)","kind":"snapshot"')
#: As many unreadable lines are kept; the others are only counted.
SHOWN_BROKEN = 1000


@dataclass(slots=True, weakref_slot=True)
class Recorded:
    """One recorded decision. `memory` and `rules` are present where the recording has a complete snapshot."""

    bay: str
    at_s: float  #: the time given to the decision
    wall: str  #: the same for people, RFC 3339
    snapshot: Snapshot
    memory: Memory | None = None
    rules: Rules | None = None
    events: list[Event] = field(default_factory=list)  #: its events in the journal
    gap: bool = False  #: decisions right before it are lost
    unsure: bool = False  #: some of its events may be lost


Taken = tuple[Recorded, float]  #: a decision, and when it was recorded: its events were recorded before


@dataclass(slots=True)
class _Bay:
    """The last snapshot of a bay; None: the following lines continue something that is lost."""

    snapshot: Snapshot | None = None
    plain: Fields | None = None  #: the same in JSON, in a journal of version 4
    gap: bool = False


def _earlier(since: str) -> str:
    return utc(max(unix_s(since) - WHOLE_S - SLACK_S, 0.0))


class Recording:
    """The decisions in journal directories and files (JSON Lines, also gzipped), in the order of writing: iterate once.

    `bays`: only these, if any are given. `since`: from the last complete snapshots before this time (RFC 3339, UTC) on.
    """

    def __init__(self, paths: Iterable[Path], bays: Collection[str] = (), since: str = "") -> None:
        self._journals = journals_of(files_of(paths))
        self._only = frozenset(bays)
        self._bays: dict[str, _Bay] = {}
        self._begin = _earlier(since) if since else ""  # complete snapshots before this are not needed
        self._run = ""
        self.broken: list[Finding] = []  #: the unreadable lines, the first of them
        self.broken_count = 0

    def __iter__(self) -> Iterator[Recorded]:
        for files in self._journals:
            yield from self._journal(files)

    def _journal(self, files: Sequence[Path]) -> Iterator[Recorded]:
        """The decisions of one journal."""
        streams = {name: [path for path in files if stream_of(path) == name] for name in STREAMS}
        merged = not any(streams.values())
        events = Events(
            files if merged else streams["events"], (lambda *_: None) if merged else self._broken, alone=merged
        )
        self._run = ""
        self._bays.clear()
        snapshots = files if merged else from_part(streams["snapshots"], self._begin)
        for path, number, line in records_of(snapshots, self._is_wanted):
            if isinstance(line, str):
                self._broken(path, number, line)
                self._stop()
                continue
            try:
                taken = self._take(line)
            except OlderError:
                taken = self._pass_over(path, number, SENTENCES)
            except UNREADABLE as error:
                taken = self._pass_over(path, number, unreadable(error))
            for recorded, until_s in taken:
                recorded.events, recorded.unsure = events.take(self._run, recorded.bay, recorded.at_s, until_s)
                yield recorded

    def _is_wanted(self, text: bytes) -> bool:
        found = _BAY.search(text, 0, 200)
        if found is None:
            return True
        return not self._only or found[1].decode(errors="replace") in self._only

    def _pass_over(self, path: Path, number: int, text: str) -> list[Taken]:
        self._broken(path, number, text)
        self._stop()
        return []

    def _broken(self, path: Path, number: int, text: str) -> None:
        self.broken_count += 1
        if len(self.broken) < SHOWN_BROKEN:
            self.broken.append(Finding(str(path), number, 1, text))

    def _stop(self) -> None:
        """Break continuity: the following lines do not continue the earlier ones."""
        for bay in self._bays.values():
            bay.gap = bay.gap or bay.snapshot is not None
            bay.snapshot = bay.plain = None

    def _take(self, line: Fields) -> list[Taken]:
        """The decisions in one line."""
        if line["kind"] in BREAKS and (line["kind"] == "lost" or run_of(line) != self._run):
            self._run = run_of(line) if line["kind"] == "run" else self._run
            self._stop()
        if line["kind"] != "snapshot":
            return []
        bay = self._bays.setdefault(line["bay"], _Bay())
        if line.get("whole"):
            return [] if line["wall"] < self._begin else [self._whole(line, bay)]
        if bay.snapshot is None:
            return []  # what it continues is lost
        return [self._single(line, bay)] if "at" not in line else self._rows(line, bay)

    def _whole(self, line: Fields, bay: _Bay) -> Taken:
        plain, memory, rules = whole(line)
        recorded = self._recorded(line, bay, snapshot_of(plain), plain)
        recorded.memory, recorded.rules = memory, rules
        return recorded, line["t"]

    def _single(self, line: Fields, bay: _Bay) -> Taken:
        """The only decision in a line of version 4."""
        before = bay.plain or {}
        now = {name: line[name] for name in Snapshot.__slots__ if name in line}
        plain = {**before, **now, "battery": {**before["battery"], **now.get("battery", {})}}
        return self._recorded(line, bay, snapshot_of(plain), plain), line["t"]

    def _rows(self, line: Fields, bay: _Bay) -> list[Taken]:
        assert bay.snapshot is not None
        rows = list(rows_of(line, bay.snapshot))
        begin_s = unix_s(line["wall"]) - line["t"]
        bay.snapshot = rows[-1][1]
        gap, bay.gap = bay.gap, False
        return [
            (Recorded(line["bay"], at_s, utc(begin_s + at_s), snapshot, gap=gap and not number), at_s)
            for number, (at_s, snapshot) in enumerate(rows)
        ]

    def _recorded(self, line: Fields, bay: _Bay, snapshot: Snapshot, plain: Fields) -> Recorded:
        gap, bay.gap = bay.gap, False
        bay.snapshot, bay.plain = snapshot, plain
        return Recorded(
            line["bay"], float(line["at_s"] if "at_s" in line else line["t"]), line["wall"], snapshot, gap=gap
        )


@dataclass(slots=True)
class Record:
    """Everything that could be read."""

    bays: dict[str, list[Recorded]] = field(default_factory=dict)  #: each bay's decisions, in order
    broken: list[Finding] = field(default_factory=list)  #: the unreadable lines


def read(paths: Iterable[Path]) -> Record:
    """All decisions at once, for short journals. Raises ConfigError for files that cannot be read at all."""
    recording, record = Recording(paths), Record()
    for one in recording:
        record.bays.setdefault(one.bay, []).append(one)
    record.broken = recording.broken
    return record


def bays_in(paths: Iterable[Path]) -> set[str]:
    """The names of all bays that have decisions there."""
    lines = (text for path in files_of(paths) if stream_of(path) != "events" for _, text in lines_of(path) if text)
    return {found[1].decode(errors="replace") for text in lines if (found := _BAY.search(text, 0, 200)) is not None}
