"""The journal: JSON Lines on disk, rotated and bounded. A full or missing disk never stops a charge, or delays a stop.

There are two streams: `events` (transition, decision, command, fault, session, station) for "why did it stop?", and the
much larger `snapshots` for replay; each has its own share of the space, so that snapshots never displace the reasons.
Both begin each run of the service with a line `run`: monotonic times of two runs, or two boots, are not comparable.

Events are on disk within half a second, as plain text; finished parts are compressed. Snapshots are compressed as they
are written, which needs many lines at once: they wait for each other, unless an event shows that they matter.
"""

import json
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.record.utc import utc
from orchestrator.service.disk import code_of
from orchestrator.service.packed import PackedFile
from orchestrator.service.records import Line
from orchestrator.service.rotating import RotatingFile
from orchestrator.text.catalogue import say

#: Of these lines; the first had no `run`, the second no causes but sentences, the third sentences in its snapshots, the
#: fourth a line for each decision.
VERSION = 5
#: The events' share of the allowed space: they are far fewer.
EVENTS_SHARE = 0.1
#: Lines waiting for a disk that does not take them; beyond that the oldest are dropped and counted. Snapshots (True)
#: are large: each line holds the readings of seconds.
BACKLOG = {False: 20_000, True: 2_000}
#: How long lines are gathered before they are written, and the pause after a disk error.
GATHER_S = 0.5
#: How long snapshots wait for more of them, unless there are this many bytes.
HOLD_S = 5.0
HOLD_BYTES = 1 << 16
RETRY_S = 5.0
#: A disk may be slow, but a writer without progress for this long hangs.
STALL_S = 30.0

#: What the service says of a bay that has records of its own.
OWN = frozenset({"bay_begins", "bay_goes"})

T = TypeVar("T")
Entry = tuple[float, float, str, Line]  #: monotonic s, wall s, bay, line


class Stream:
    """One file's lines waiting for the disk. A gap in them is marked by a line, because what follows lacks its base."""

    def __init__(self, file: RotatingFile | PackedFile, backlog: int) -> None:
        self._file, self._backlog = file, backlog
        self.bytes = 0  #: in the waiting lines
        self._lines: deque[bytes] = deque()
        self._ahead: deque[bytes] = deque()  # our own lines, written before them
        self.gap = False  #: lines are missing before the first waiting one

    def add(self, line: bytes) -> int:
        """Add a line; returns how many are lost because of it."""
        self._lines.append(line)
        self.bytes += len(line)
        if len(self._lines) <= self._backlog:
            return 0
        self.bytes -= len(self._lines.popleft())
        self.gap = True
        return 1

    def write(self, lost: bytes) -> None:
        """Write them, or raise OSError; `lost` is the line that marks a gap."""
        if self.gap and self._lines:
            self._ahead.append(lost)
            self.gap = False
        self._file.take(self._ahead)
        self._file.take(self._lines)
        self.bytes = 0


class Journal:
    """Takes lines from any thread without blocking; its own thread writes them.

    Lines that the disk does not take wait for it; `lost` counts those dropped because there were too many.
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
        self._directory, self._boot, self._run_name = directory, boot, ""
        total = int(max_mb * 1_000_000)
        events, snapshots = int(total * EVENTS_SHARE), int(total * (1 - EVENTS_SHARE))
        files: dict[bool, RotatingFile | PackedFile] = {
            False: RotatingFile(directory, "events", events, self._begin, durable=True),
            True: PackedFile(directory, "snapshots", snapshots, self._begin),
        }
        self._streams = {kind: Stream(file, BACKLOG[kind]) for kind, file in files.items()}
        self._held_s: float | None = None  # since when snapshots wait for more of them
        self._waiting: dict[bool, deque[Entry]] = {snapshot: deque(maxlen=most) for snapshot, most in BACKLOG.items()}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._turn_s = clock()
        self._problem: Cause | None = None
        self.lost = 0
        self._lost_before = 0  # its value when the waiting lines were last taken

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def put(self, bay: str, line: Line, t_s: float | None = None) -> None:
        """Add a line about this time; by default the present."""
        waiting = self._waiting[line[0] == "snapshot"]
        if len(waiting) == waiting.maxlen:
            self.lost += 1
        now_s, wall_s = self._clock(), self._wall()
        waiting.append((now_s, wall_s, bay, line) if t_s is None else (t_s, wall_s - (now_s - t_s), bay, line))

    def note(self, cause: Cause, language: str) -> None:
        """Add what the service says of itself: its beginning and end, its disk, its sockets, its guardian."""
        if cause.id not in OWN:
            bay = cause.param("bay")
            said = {"text": say(cause, language), "cause": plain(cause)}
            self.put(bay if isinstance(bay, str) else "", ("station", said))

    def problem(self, now_s: float) -> Cause | None:
        """Why nothing is being written; None while all is well."""
        if not self._thread.is_alive():
            return Cause("journal_dead")
        if now_s - self._turn_s > STALL_S:
            return Cause.of("journal_hangs", lasted_s=now_s - self._turn_s)
        return self._problem

    def stalled(self, _now_s: float) -> bool:
        """True if the writer has died. Waiting for a disk does not count: no disk stops a charge."""
        return not self._thread.is_alive()

    def close(self) -> None:
        """Write what is left and end; gives a stalled disk one second."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(1.0)

    def _run(self) -> None:
        while not self._ended.wait(RETRY_S if self._problem else GATHER_S):
            self._turn_s = self._clock()
            self._write(all_of_it=False)
        self._write()

    def _write(self, *, all_of_it: bool = True) -> None:
        if self.lost > self._lost_before:
            for stream in self._streams.values():
                stream.gap = True
        news = bool(self._waiting[False])
        for snapshot, waiting in self._waiting.items():
            for entry in _drained(waiting):
                self.lost += self._add(self._streams[snapshot], entry)
        self._lost_before = self.lost
        try:
            self._streams[False].write(self._own_line("lost", {"lines": self.lost}))
            if all_of_it or news or self._problem or self._due():
                self._streams[True].write(self._own_line("lost", {"lines": self.lost}))
                self._held_s = None
            self._settle(None)
        except OSError as error:
            file = str(error.filename or self._directory)
            self._settle(Cause.of("journal_failed", error=code_of(error), file=file))

    def _add(self, stream: Stream, entry: Entry) -> int:
        """Add the line; returns how many are lost. A defect in making one costs that line, not the station."""
        try:
            return stream.add(_line(entry))
        except Exception:  # noqa: BLE001 - without its writer the service would end
            return 1 + stream.add(self._own_line("lost", {"lines": self.lost + 1}))

    def _due(self) -> bool:
        """Whether the snapshots have waited long enough, or are many."""
        waiting = self._streams[True].bytes
        if not waiting:
            return False
        if self._held_s is None:
            self._held_s = self._clock()
        return waiting >= HOLD_BYTES or self._clock() - self._held_s >= HOLD_S

    def _begin(self) -> bytes:
        """The line with which this run, and each part of a file, begins."""
        self._run_name = self._run_name or f"{self._boot}/{self._clock():.6f}/{self._wall():.0f}"
        return self._own_line("run", {"version": VERSION, "boot": self._boot, "run": self._run_name})

    def _own_line(self, kind: str, fields: dict[str, object]) -> bytes:
        return _line((self._clock(), self._wall(), "", (kind, fields)))

    def _settle(self, problem: Cause | None) -> None:
        if problem != self._problem:
            self._problem = problem
            self._say(problem or Cause("journal_again"))


def _drained(waiting: "deque[T]") -> Iterator[T]:
    """Take out all items, while other threads may add more."""
    with suppress(IndexError):
        while True:
            yield waiting.popleft()


def _line(entry: Entry) -> bytes:
    t_s, wall_s, bay, (kind, fields) = entry
    head = {"t": t_s, "wall": utc(wall_s), "bay": bay, "kind": kind}
    said = fields() if callable(fields) else fields
    text = json.dumps({**head, **said}, ensure_ascii=False, separators=(",", ":")) + "\n"
    return text.encode(errors="backslashreplace")  # file names need not be valid text; the result is still JSON
