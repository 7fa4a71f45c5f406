"""The events of a journal, each for the decision that caused it, read alongside the decisions.

Theory of operation. Both streams name the runs of the service, in the same order; within a run the monotonic clock
orders everything. So only a few events wait for their decisions at any time. Where lines of the events are missing,
nobody can say whether a decision had events: it is *unsure*.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import inf
from pathlib import Path

from orchestrator.service.journal_files import Fields, may_continue, records_of

Event = tuple[str, Mapping[str, object]]  #: kind, fields
#: The records that `decision_lines` writes for a decision.
EVENTS = frozenset({"transition", "command", "fault", "session", "decision"})
#: Clocks of lines next to each other may differ by this much: what is decided is timed in whole milliseconds.
SLACK_S = 0.01
#: Waiting events of one bay; those of decisions that are lost are never asked for.
MOST = 10_000


class Events:
    """The events of one journal. Ask in the order of the decisions."""

    def __init__(self, files: Sequence[Path], broken: Callable[[Path, int, str], None], *, alone: bool) -> None:
        self._broken = broken
        self._alone = alone  # the decisions are in the same file
        self._runs = {run_of(line) for _, _, line in records_of(files, _is_run) if isinstance(line, dict)}
        self._lines = records_of(files, _is_event)
        self._run = self._run_read = ""  # of the last line taken in, and read
        self._waiting: dict[str, deque[Fields]] = {}
        self._holes: list[tuple[float, float]] = []  # between these times of this run something is missing
        self._last_s = -inf  # the time of the last line taken in …
        self._torn = bool(files) and may_continue(files[0])  # … after which something is missing
        self._next: Fields | None = None
        self._advance()

    def take(self, run: str, bay: str, at_s: float, until_s: float) -> tuple[list[Event], bool]:
        """The events of the bay's decision that was made and recorded between these times; and whether that is unsure.

        Earlier ones are of decisions that are lost.
        """
        if not self._seek(run):
            return [], True
        while self._next is not None and self._next["kind"] != "run" and self._next["t"] <= until_s + SLACK_S:
            self._advance()
        waiting, found = self._waiting.get(bay), list[Event]()
        while waiting and waiting[0]["t"] <= until_s:
            line = waiting.popleft()
            if line["t"] >= at_s:
                fields = {name: value for name, value in line.items() if name not in ("t", "wall", "bay", "kind")}
                found.append((line["kind"], fields))
        return found, any(since_s <= at_s <= end_s for since_s, end_s in self._holes)

    def _seek(self, run: str) -> bool:
        """Go to this run; False if nothing is known of it."""
        while self._run != run and run in self._runs and self._next is not None:
            self._advance()
        return self._run == run and (bool(run) or self._alone)

    def _advance(self) -> None:
        """Take the next line in, and read the one after it."""
        line = self._next
        if line is not None:
            self._take_in(line)
        self._next = self._read()
        if self._torn:
            new_run = self._next is None or self._next["kind"] == "run"
            self._holes.append((self._last_s, inf if self._next is None or new_run else self._next["t"]))
            self._torn = new_run

    def _take_in(self, line: Fields) -> None:
        if line["kind"] == "run":
            self._run, self._last_s = run_of(line), -inf
            self._waiting.clear()
            self._holes.clear()
            return
        self._last_s = line["t"]
        if line["kind"] in EVENTS:
            self._waiting.setdefault(line["bay"], deque(maxlen=MOST)).append(line)

    def _read(self) -> Fields | None:
        """The next line, but for those that say nothing new."""
        for path, number, line in self._lines:
            if isinstance(line, str):
                self._broken(path, number, line)
                self._torn = True
            elif line["kind"] == "lost":
                self._torn = True
            elif line["kind"] != "run":
                return line
            elif run_of(line) != self._run_read:
                self._run_read = run_of(line)
                return line
        return None


def run_of(line: Fields) -> str:
    """The run that begins with this line; a part of a run that goes on names it as well."""
    return str(line.get("run") or line["t"])


def _is_run(text: bytes) -> bool:
    return b'"kind":"run"' in text


def _is_event(text: bytes) -> bool:
    return b'"kind":"snapshot"' not in text[:200]
