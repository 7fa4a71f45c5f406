"""The journal: JSON Lines on disk, rotated and bounded. A disk that is full or gone never stops a charge, nor a stop.

Two streams: `events` (transition, decision, command, fault, session) for "why did it stop?", and `snapshots`, far more
of it, for a replay; each has its own share of the space, so that snapshots never push the reasons out. Beside them lies
what the next run must know (`kept.py`).
"""

import json
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

from orchestrator.service.kept import Kept, write_kept
from orchestrator.service.records import Line

#: Of the allowed space, what the events may take, and into how many files each stream is divided.
EVENTS_SHARE = 0.25
FILES = 8
#: Lines that wait for a disk that does not take them; beyond it the oldest are dropped and counted.
BACKLOG = 20_000
#: How long lines are gathered before they are written, and how long a refused disk is left alone.
GATHER_S = 0.5
RETRY_S = 5.0
#: A disk may be slow, a loop that has not turned for this long hangs.
STALL_S = 30.0

T = TypeVar("T")
Entry = tuple[float, float, str, Line]  #: monotonic s, wall s, bay, line


class RotatingFile:
    """`NAME.jsonl` is written; `NAME.1.jsonl` … `NAME.7.jsonl` are older and go when there is no space for them."""

    def __init__(self, directory: Path, name: str, max_bytes: int) -> None:
        self._directory, self._name = directory, name
        self._max_bytes = max(max_bytes // FILES, 4096)

    def append(self, text: str) -> None:
        """Add whole lines; OSError where the disk does not take them."""
        path = self._path(0)
        self._directory.mkdir(parents=True, exist_ok=True, mode=0o750)
        if path.exists() and path.stat().st_size + len(text) > self._max_bytes:
            self._rotate()
        with path.open("a", encoding="utf-8") as file:
            file.write(text)

    def _path(self, age: int) -> Path:
        return self._directory / (f"{self._name}.{age}.jsonl" if age else f"{self._name}.jsonl")

    def _rotate(self) -> None:
        for age in range(FILES - 1, 0, -1):
            if self._path(age - 1).exists():
                self._path(age - 1).replace(self._path(age))


class Journal:
    """Takes lines from any thread without ever waiting; one thread of its own writes them, and what people read.

    `problem` says why the disk does not take them, "" while it does; `lost` counts the lines that had to be dropped.
    """

    def __init__(self, directory: Path, max_mb: float, clock: Callable[[], float], wall: Callable[[], float]) -> None:
        self._clock, self._wall = clock, wall
        self._directory = directory
        self._kept: dict[str, Kept] = {}
        self._kept_changed = False
        total = int(max_mb * 1_000_000)
        self._files = {
            False: RotatingFile(directory, "events", int(total * EVENTS_SHARE)),
            True: RotatingFile(directory, "snapshots", int(total * (1 - EVENTS_SHARE))),
        }
        self._waiting: deque[Entry] = deque(maxlen=BACKLOG)
        self._said: deque[str] = deque(maxlen=1000)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._turn_s = clock()
        self.problem = ""
        self.lost = 0

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def put(self, bay: str, line: Line) -> None:
        """Add a line with the present time."""
        if len(self._waiting) == BACKLOG:
            self.lost += 1
        self._waiting.append((self._clock(), self._wall(), bay, line))

    def keep(self, bay: str, kept: Kept) -> None:
        """What the next run must know of a bay, from now on."""
        self._kept = {**self._kept, bay: kept}
        self._kept_changed = True

    def say(self, text: str) -> None:
        """A line for people, on standard error."""
        self._said.append(text)

    def stalled(self, now_s: float) -> bool:
        """True when the writer hangs or has ended."""
        return not self._thread.is_alive() or now_s - self._turn_s > STALL_S

    def close(self) -> None:
        """Write what is left and end; gives a stalled disk one second."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(1.0)

    def _run(self) -> None:
        while not self._ended.wait(RETRY_S if self.problem else GATHER_S):
            self._turn_s = self._clock()
            self._write()
        self._write()

    def _write(self) -> None:
        for text in _drained(self._said):
            print(text, file=sys.stderr, flush=True)  # noqa: T201 - what people read
        entries = list(_drained(self._waiting))
        try:
            self._write_kept()
            for is_snapshot, file in self._files.items():
                lines = [_text(entry) for entry in entries if (entry[3][0] == "snapshot") is is_snapshot]
                if lines:
                    file.append("".join(lines))
            self._settle("")
        except OSError as error:
            self.lost += len(entries)
            self._settle(f"the journal cannot be written: {error.strerror}: {error.filename}")

    def _write_kept(self) -> None:
        if self._kept_changed:
            self._kept_changed = False  # before it is read: a change from now on is written the next time
            try:
                write_kept(self._directory, self._kept)
            except OSError:
                self._kept_changed = True
                raise

    def _settle(self, problem: str) -> None:
        if problem != self.problem:
            self.problem = problem
            print(problem or "the journal is being written again", file=sys.stderr, flush=True)  # noqa: T201


def _drained(waiting: "deque[T]") -> Iterator[T]:
    """Take out what is there, while other threads add to it."""
    with suppress(IndexError):
        while True:
            yield waiting.popleft()


def _text(entry: Entry) -> str:
    t_s, wall_s, bay, (kind, fields) = entry
    head = {"t": t_s, "wall": rfc3339(wall_s), "bay": bay, "kind": kind}
    return json.dumps({**head, **fields}, ensure_ascii=False, separators=(",", ":")) + "\n"


def rfc3339(wall_s: float) -> str:
    """A wall-clock time as people and programs read it, in UTC."""
    return datetime.fromtimestamp(wall_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
