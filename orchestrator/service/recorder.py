"""Writes the record of charges: one file of JSON Lines a month, in the journal's directory. No disk stops a charge.

Theory of operation. The control loop puts records here; the thread appends them and syncs the file, as the journal
does with events. A begin and an end are never dropped, however long a disk does not take them; a checkpoint is, because
the next one has all of it. What a power cut has torn is closed by a line end before the next record, and readers skip
it. The thread reads first what earlier runs have left open.
"""

import os
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from orchestrator.model import Cause
from orchestrator.record import months
from orchestrator.record.charge import Charge
from orchestrator.record.earlier import Earlier
from orchestrator.record.lines import CHECKPOINT, Record, encoded
from orchestrator.record.monthfile import DAMAGED, lines, opened
from orchestrator.record.ulid import CHANCE, after
from orchestrator.service.curves import Curves
from orchestrator.service.disk import code_of, make_directory, sync_directory
from orchestrator.service.rotating import append, cut_off, pack

#: More records waiting for a disk than this: checkpoints are dropped.
MOST = 1000
#: The pause after a disk error, and how often the thread looks in any case.
RETRY_S, LOOK_S = 5.0, 60.0
#: How often a file that cannot be read is tried, before the record goes on without it.
TRIES = 3


class Recorder:
    """The record of a station's charges. Nothing here waits for the disk, except `close`.

    Used by the control loop's thread, but for `stalled` and the thread's own methods.
    """

    def __init__(
        self,
        directory: Path,
        years: float,
        wall: Callable[[], float],
        say: Callable[[Cause], None] = lambda _: None,
        *,
        boot: str = "",
        curves_days: float = 0.0,
    ) -> None:
        self.boot = boot  #: of the machine
        self._folder, self._years, self._wall, self._say = directory / months.FOLDER, years, wall, say
        self._waiting: deque[Record] = deque()
        self._curves = Curves(self._folder, curves_days) if curves_days else None
        self._points: deque[tuple[str, str, bool]] = deque(maxlen=MOST)  # (charge, lines, whether it has ended)
        self._problem: Cause | None = None
        self._name = ""  # of the file being written; "" before the first
        self._opened: list[Charge] = []
        self._last: dict[str, Charge] = {}
        self._last_id = ""
        self._tries, self._ended = 0, False
        self._loaded, self._wake = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="record", daemon=True)

    # --- used by the control loop -------------------------------------------------------------------------------------

    def start(self) -> None:
        """Read what earlier runs have left open, then write."""
        self._thread.start()

    @property
    def loaded(self) -> bool:
        """Whether it is known what earlier runs have left open."""
        return self._loaded.is_set()

    def opened(self, bay: str, port: str) -> list[Charge]:
        """The charges that earlier runs have left open in this bay, the oldest first; each is given once."""
        mine = [one for one in self._opened if one.head["bay"] == bay]
        mine = mine or [one for one in self._opened if one.head["port"] == port]  # it was renamed
        self._opened = [one for one in self._opened if one not in mine]
        return mine

    def last(self, bay: str) -> Charge | None:
        """The last charge that earlier runs have seen end in this bay."""
        return self._last.get(bay)

    def new_id(self, unix_s: float) -> str:
        """The id of a charge that begins now."""
        self._last_id = after(self._last_id, unix_s, os.urandom(CHANCE))
        return self._last_id

    def put(self, record: Record) -> None:
        """Have this written; a begin or an end at once."""
        if record["type"] == CHECKPOINT and len(self._waiting) >= MOST:
            return
        self._waiting.append(record)
        self._wake.set()

    def put_curve(self, id_: str, text: str, *, ended: bool) -> None:
        """Have these points of a charge written, sooner or later; the oldest are lost where no disk takes them."""
        self._points.append((id_, text, ended))
        self._wake.set()

    def failed(self, error: Exception) -> None:
        """A defect in keeping the record: it costs the record, not the charge."""
        self._settle(Cause.of("record_internal", error=repr(error)))

    def stalled(self, _now_s: float) -> bool:
        """True if the writer has died. Waiting for a disk does not count: no disk stops a charge."""
        return not self._thread.is_alive()

    def close(self, within_s: float = 1.0) -> None:
        """Write what is left and end; a disk that stands still gets this long."""
        self._ended = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(within_s)

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            ended = self._ended
            self.turn()
            if ended:
                return
            self._wake.wait(RETRY_S if self._problem else LOOK_S)
            self._wake.clear()

    def turn(self) -> None:
        """Read what is not read yet, and write what waits."""
        try:
            if not self.loaded:
                self._load()
            if self.loaded:
                self._write()
                self._write_curves()
        except OSError as error:
            self._name = ""  # what came of it is looked at before the next record
            self._settle(Cause.of("record_failed", error=code_of(error), file=str(error.filename or self._folder)))
        except Exception as error:  # noqa: BLE001 - without its writer the service would end
            self.failed(error)
        else:
            self._settle(None)

    def _load(self) -> None:
        """Read the newest files, and older ones for the begin of what is open. A file that cannot be read is tried."""
        earlier = Earlier()
        self._tries += 1
        try:
            names = self._names()
            first = months.newest(self._wall(), names)
            for name in first:
                self._take(name, earlier)
            for name in sorted(set(months.files(names)) - set(first), reverse=True):
                if earlier.is_whole:
                    break
                self._take(name, earlier)
        except OSError:
            if self._tries < TRIES:
                raise
        self._opened, self._last, self._last_id = earlier.open(), earlier.last(), earlier.last_id
        self._loaded.set()

    def _take(self, name: str, earlier: Earlier) -> None:
        with suppress(*DAMAGED), opened(self._folder / name) as file:
            earlier.take(lines(file))

    def _write(self) -> None:
        if not self._waiting:
            return
        name, now = self._name, months.current(self._wall(), self._names() if not self._name else [self._name])
        path = self._folder / now
        if name != now:
            self._begin(path)
        count = len(self._waiting)
        data = b"".join(encoded(self._waiting[at]) for at in range(count))
        append(path, (cut_off(path) if name != now else b"") + data, durable=True)
        if name != now:
            sync_directory(self._folder)
            self._name = now
        for _ in range(count):
            self._waiting.popleft()

    def _write_curves(self) -> None:
        while self._points:
            id_, text, ended = self._points[0]
            if self._curves is not None and text:
                self._curves.write(id_, text, self._wall())
            if self._curves is not None and ended:
                self._curves.end(id_)
            if self._points[0][0] == id_:  # the oldest may have been dropped meanwhile
                self._points.popleft()

    def _begin(self, path: Path) -> None:
        """A new month, or the first record of this run: old months go, and finished ones are compressed."""
        make_directory(self._folder)
        for name in months.outdated(self._wall(), {*self._names(), path.name}, self._years):
            os.unlink(self._folder / name)  # noqa: PTH108 - as in disk.py
        with suppress(OSError):  # they stay as they are: the next month tries again
            for name in months.finished({*self._names(), path.name}):
                pack(self._folder / name)

    def _names(self) -> list[str]:
        try:
            return os.listdir(self._folder)  # noqa: PTH208 - as in disk.py
        except FileNotFoundError:
            return []

    def _settle(self, problem: Cause | None) -> None:
        if problem != self._problem:
            self._problem = problem
            self._say(problem or Cause("record_again"))
