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

from orchestrator.service.kept import FILE, Kept, write_kept
from orchestrator.service.records import Line
from orchestrator.service.rotating import RotatingFile

#: Of the allowed space, what the events may take.
EVENTS_SHARE = 0.25
#: Lines that wait for a disk that does not take them; beyond it the oldest are dropped and counted.
BACKLOG = 20_000
#: How long lines are gathered before they are written, and how long a refused disk is left alone.
GATHER_S = 0.5
RETRY_S = 5.0
#: A disk may be slow, a loop that has not turned for this long hangs.
STALL_S = 30.0

T = TypeVar("T")
Entry = tuple[float, float, str, Line]  #: monotonic s, wall s, bay, line


class Journal:
    """Takes lines from any thread without ever waiting; one thread of its own writes them, and what people read.

    Lines that the disk does not take wait for it; `lost` counts those that were dropped because there were too many.
    """

    def __init__(self, directory: Path, max_mb: float, clock: Callable[[], float], wall: Callable[[], float]) -> None:
        self._clock, self._wall = clock, wall
        self._directory = directory
        self._kept: dict[str, Kept] = {}
        self._kept_changed = False
        self._unkept = ""
        total = int(max_mb * 1_000_000)
        self._streams: dict[bool, tuple[RotatingFile, deque[bytes]]] = {
            False: (RotatingFile(directory, "events", int(total * EVENTS_SHARE)), deque()),
            True: (RotatingFile(directory, "snapshots", int(total * (1 - EVENTS_SHARE))), deque()),
        }
        self._waiting: deque[Entry] = deque(maxlen=BACKLOG)
        self._said: deque[str] = deque(maxlen=1000)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._turn_s = clock()
        self._problem = ""
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

    @property
    def unkept(self) -> str:
        """Why what is kept now would be lost with a restart, for a person; "" while it would not be."""
        return self._unkept

    def problem(self, now_s: float) -> str:
        """Why nothing is being written, for a person; "" while all is well."""
        if not self._thread.is_alive():
            return "the journal is not being written"
        if now_s - self._turn_s > STALL_S:
            return (
                f"the journal has not been written for {now_s - self._turn_s:.0f} s: the disk, or standard error, hangs"
            )
        return self._problem

    def stalled(self, _now_s: float) -> bool:
        """True when the writer has died. That it waits for a disk is no hang: no disk stops a charge."""
        return not self._thread.is_alive()

    def close(self) -> None:
        """Write what is left and end; gives a stalled disk one second."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(1.0)

    def _run(self) -> None:
        while not self._ended.wait(RETRY_S if self._problem else GATHER_S):
            self._turn_s = self._clock()
            self._write()
        self._write()

    def _write(self) -> None:
        for text in _drained(self._said):
            _tell(text)
        for entry in _drained(self._waiting):
            lines = self._streams[entry[3][0] == "snapshot"][1]
            lines.append(_line(entry))
            if len(lines) > BACKLOG:
                lines.popleft()
                self.lost += 1
        try:
            self._write_kept()
            for file, lines in self._streams.values():
                file.take(lines)
            self._settle("")
        except OSError as error:
            self._settle(f"the journal cannot be written: {error.strerror}: {error.filename or self._directory}")

    def _write_kept(self) -> None:
        if self._kept_changed:
            self._kept_changed = False  # before it is read: a change from now on is written the next time
            try:
                write_kept(self._directory, self._kept)
            except OSError as error:
                self._kept_changed = True
                self._unkept = f"a restart would forget latched faults, {self._directory / FILE}: {error.strerror}"
                raise
            self._unkept = ""

    def _settle(self, problem: str) -> None:
        if problem != self._problem:
            self._problem = problem
            _tell(problem or "the journal is being written again")


def _tell(text: str) -> None:
    """To whom it may concern; nobody has to listen."""
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)  # noqa: T201 - what people read


def _drained(waiting: "deque[T]") -> Iterator[T]:
    """Take out what is there, while other threads add to it."""
    with suppress(IndexError):
        while True:
            yield waiting.popleft()


def _line(entry: Entry) -> bytes:
    t_s, wall_s, bay, (kind, fields) = entry
    head = {"t": t_s, "wall": rfc3339(wall_s), "bay": bay, "kind": kind}
    text = json.dumps({**head, **fields}, ensure_ascii=False, separators=(",", ":")) + "\n"
    return text.encode(errors="backslashreplace")  # of file names that are no text; still JSON


def rfc3339(wall_s: float) -> str:
    """A wall-clock time as people and programs read it, in UTC."""
    return datetime.fromtimestamp(wall_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
