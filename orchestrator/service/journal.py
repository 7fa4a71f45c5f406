"""The journal: JSON Lines on disk, rotated and bounded. A disk that is full or gone never stops a charge, nor a stop.

Two streams: `events` (transition, decision, command, fault, session) for "why did it stop?", and `snapshots`, far more
of it, for a replay; each has its own share of the space, so that snapshots never push the reasons out. Both begin each
run of the service with a line `run`: monotonic times of two runs, or two boots, have nothing to do with each other.
"""

import json
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TypeVar

from orchestrator.model import Cause
from orchestrator.service.disk import code_of
from orchestrator.service.records import Line
from orchestrator.service.rotating import RotatingFile

#: Of these lines; the first had no `run`, the second no causes but sentences, the third sentences in its snapshots.
VERSION = 4
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


class Stream:
    """The lines of one file that wait for the disk. A gap in them is a line of its own: what follows lacks its base."""

    def __init__(self, file: RotatingFile, begin: Callable[[], bytes]) -> None:
        self._file, self._begin = file, begin
        self._lines: deque[bytes] = deque()
        self._ahead: deque[bytes] = deque()  # our own lines, which come before them
        self._begun = False
        self.gap = False  #: lines are missing before the first one that waits

    def add(self, line: bytes) -> int:
        """One line more; how many are lost by it."""
        if not self._begun:
            self._begun = True
            self._ahead.append(self._begin())
        self._lines.append(line)
        if len(self._lines) <= BACKLOG:
            return 0
        self._lines.popleft()
        self.gap = True
        return 1

    def write(self, lost: bytes) -> None:
        """Bring them to the disk, or raise OSError; `lost` is the line that stands for a gap."""
        if self.gap and self._lines:
            self._ahead.append(lost)
            self.gap = False
        self._file.take(self._ahead)
        self._file.take(self._lines)


class Journal:
    """Takes lines from any thread without ever waiting; one thread of its own writes them.

    Lines that the disk does not take wait for it; `lost` counts those that were dropped because there were too many.
    """

    def __init__(
        self,
        directory: Path,
        max_mb: float,
        clock: Callable[[], float],
        wall: Callable[[], float],
        *,
        boot: str = "",
        say: Callable[[Cause], None] = lambda _: None,
    ) -> None:
        self._clock, self._wall, self._say = clock, wall, say
        self._directory = directory
        total = int(max_mb * 1_000_000)
        events, snapshots = int(total * EVENTS_SHARE), int(total * (1 - EVENTS_SHARE))
        begun = ("run", {"version": VERSION, "boot": boot, "run": f"{boot}/{clock():.6f}"})
        self._streams: dict[bool, Stream] = {
            False: Stream(RotatingFile(directory, "events", events, durable=True), partial(self._own_line, *begun)),
            True: Stream(RotatingFile(directory, "snapshots", snapshots), partial(self._own_line, *begun)),
        }
        self._waiting: deque[Entry] = deque(maxlen=BACKLOG)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._turn_s = clock()
        self._problem: Cause | None = None
        self.lost = 0
        self._lost_before = 0  # as it was when the lines that wait were last taken

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def put(self, bay: str, line: Line) -> None:
        """Add a line with the present time."""
        if len(self._waiting) == BACKLOG:
            self.lost += 1
        self._waiting.append((self._clock(), self._wall(), bay, line))

    def problem(self, now_s: float) -> Cause | None:
        """Why nothing is being written; None while all is well."""
        if not self._thread.is_alive():
            return Cause("journal_dead")
        if now_s - self._turn_s > STALL_S:
            return Cause.of("journal_hangs", lasted_s=now_s - self._turn_s)
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
        if self.lost > self._lost_before:
            for stream in self._streams.values():
                stream.gap = True
        for entry in _drained(self._waiting):
            self.lost += self._streams[entry[3][0] == "snapshot"].add(_line(entry))
        self._lost_before = self.lost
        try:
            for stream in self._streams.values():
                stream.write(self._own_line("lost", {"lines": self.lost}))
            self._settle(None)
        except OSError as error:
            file = str(error.filename or self._directory)
            self._settle(Cause.of("journal_failed", error=code_of(error), file=file))

    def _own_line(self, kind: str, fields: dict[str, object]) -> bytes:
        return _line((self._clock(), self._wall(), "", (kind, fields)))

    def _settle(self, problem: Cause | None) -> None:
        if problem != self._problem:
            self._problem = problem
            self._say(problem or Cause("journal_again"))


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
