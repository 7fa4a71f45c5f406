"""Stores the persisted state on disk: one file, one owner, one thread that waits only for its disk.

Theory of operation. The control loop puts each bay's state here; the thread writes the whole file whenever anything
changes that may be relied on (`Persisted.gist`), and plain counters periodically. Every such change has a revision;
answers and starts wait until `persisted_revision` has reached it. A disk that is full, gone or hung delays nobody:
`not_persisted` reports it, and no charge begins.

A restart is neither a reset nor a start. If the file cannot be read, every bay is held; the file is moved aside, never
overwritten. If the disk does not answer in time, nothing is written at all, and the next start finds the old state.
"""

import threading
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from orchestrator.core.persisted import COUNTERS_S, Persisted
from orchestrator.errors import RequestError, StartError
from orchestrator.model import Cause
from orchestrator.service.disk import code_of, replace_file
from orchestrator.service.loading import FILE, FIRST_FILE, held, load, move_aside
from orchestrator.service.ownership import Ownership
from orchestrator.service.past import Entry, Place
from orchestrator.service.remembered import Remembered
from orchestrator.service.stateformat import Stamp, encode

#: A change that is not on disk within this counts as not persisted (FAULTS P9).
KEPT_WITHIN_S = 2.0
#: How often writing is retried after a disk error.
RETRY_S = 1.0


class Store:
    """The persisted state of a station's bays. `put` and the queries never block and are thread-safe.

    `clock` is monotonic, `wall` the wall clock, `boot` identifies the boot of the machine. `on_persisted` is called
    from the store's thread with the places whose changes have just reached the disk; it must be quick.
    """

    def __init__(
        self,
        directory: Path,
        places: Sequence[Place],
        clock: Callable[[], float],
        wall: Callable[[], float],
        *,
        boot: str = "",
        on_persisted: Callable[[Collection[Place]], None] = lambda _: None,
    ) -> None:
        self.path = directory / FILE
        self._directory, self._places = directory, tuple(places)
        self._clock, self._wall, self._boot, self._on_persisted = clock, wall, boot, on_persisted
        self._lock = threading.Lock()  # guards the following; never held while waiting for a disk
        self._table: dict[Place, Remembered] = {}
        self._gists: dict[Place, object] = {}  # as last written
        self._disk: dict[Place, Persisted] = {}  # without entries that the write under way may change
        self._revision, self.persisted_revision = 1, 0  # the file is written once at the start
        self._pending_s: float | None = None  # since when a change has been waiting for the disk …
        self._later_s: float | None = None  # … and one that is not part of the write under way
        self._counted = False  # a counter has changed
        self._problem: Cause | None = None
        self._foreign: Cause | None = None
        self._blind: Cause | None = None
        self._run_number = 1
        self._aside: tuple[str, ...] = ()
        self._ownership = Ownership(directory, clock)
        self._written_s = self._failed_s = 0.0
        self._ended = False
        self._wake, self._loaded = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="store", daemon=True)

    # --- used by the control loop -------------------------------------------------------------------------------------

    def start(self) -> None:
        """Lock the directory, read the last run's state, then write changes."""
        self._thread.start()

    def wait(self, within_s: float) -> bool:
        """Whether the past is known within this; StartError where another service owns the directory."""
        known = self._loaded.wait(within_s)
        if self._foreign is not None:
            raise StartError(self._foreign)
        return known

    def past(self, place: Place) -> Persisted:
        """The state that a bay begins with. If it has not been read by the first call, it is not used at all."""
        with self._lock:
            if not self._table:
                self._blind = Cause.of("disk_silent", directory=str(self._directory))
                self._begin(held(self._places, Cause.of("state_disk_silent", directory=str(self._directory))))
            return self._table[place].persisted

    def strays(self) -> list[Place]:
        """The places where a charger may be running on a port that no bay has now."""
        with self._lock:
            running = [place for place, put in self._table.items() if put.persisted.running]
        return [place for place in running if not any(place.is_port_of(one) for one in self._places)]

    def put(self, place: Place, persisted: Persisted) -> int:
        """Store this state. Returns its revision: it is on disk once `persisted_revision` has reached it."""
        now_s = self._clock()
        with self._lock:
            old = self._table[place]
            new = self._table[place] = Remembered.of(persisted, now_s, old.run)
            if new.gist == old.gist:
                self._counted = self._counted or new.counters != old.counters
                return self._revision
            self._revision += 1
            if self._pending_s is None:
                self._pending_s = now_s
            elif self._later_s is None:
                self._later_s = now_s
            revision = self._revision
        self._wake.set()
        return revision

    def on_disk(self, place: Place) -> Persisted | None:
        """This place's state on disk, with the ages of that time; None while a write may be changing `running`."""
        return self._disk.get(place)

    def not_persisted(self, now_s: float) -> Cause | None:
        """Why a restart would forget something; None while it would not."""
        pending_s, problem = self._pending_s, self._blind or self._problem
        if problem is None and pending_s is not None and now_s - pending_s > KEPT_WITHIN_S:
            problem = Cause.of("disk_slow", file=str(self.path), limit_s=KEPT_WITHIN_S)
        if problem is None:
            return None
        return Cause.of("would_forget", problem=problem, then=Cause("restart_then") if self._blind else None)

    def refuse_not_persisted(self, now_s: float) -> None:
        """RequestError where what is to be changed now would be forgotten."""
        if why := self.not_persisted(now_s):
            raise RequestError(Cause.of("not_done", problem=why))

    def stalled(self, _now_s: float) -> bool:
        """True if the writer has died. Waiting for its disk does not count: `not_persisted` reports that."""
        return not self._thread.is_alive()

    def close(self, within_s: float) -> Cause | None:
        """Write what is left and end; why something could not be kept, None if all is."""
        self._ended = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(within_s)
        if self._blind or self._problem:
            return self._blind or self._problem
        if self._thread.is_alive() or self.persisted_revision < self._revision:
            return Cause.of("disk_hangs", file=str(self.path), limit_s=within_s)
        return None

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            entries = self._load()
        except BlockingIOError:
            self._foreign = Cause.of("directory_taken", directory=str(self._directory))
            self._loaded.set()
            return
        with self._lock:
            if not self._blind:
                self._begin(entries)
        self._loaded.set()
        while not self._blind:
            ended = self._ended
            self.turn(ended=ended)
            if ended:
                break
            self._wake.wait(RETRY_S)
            self._wake.clear()
        self._ownership.give_up()

    def turn(self, *, ended: bool = False) -> None:
        """Write what is due; before the end, everything."""
        try:
            if self._due(ended=ended):
                self._write()
        except Exception as error:  # noqa: BLE001 - if this thread died, every charge would end
            self._fail(Cause.of("disk_internal", error=repr(error)), self._clock())

    def _begin(self, entries: Sequence[Entry]) -> None:
        now_s = self._clock()
        self._table = {entry.place: Remembered.of(entry.persisted, now_s, entry.run) for entry in entries}
        self._pending_s = now_s

    def _load(self) -> Sequence[Entry]:
        """Every place's entry at the start; BlockingIOError if another service owns the directory."""
        try:
            self._ownership.take(lambda: self._ended)
        except BlockingIOError:
            raise
        except OSError as error:
            self._problem = _said(error, self._directory)
        loaded = load(self._directory, self._places, self._stamp())
        self._run_number, self._aside = loaded.run, loaded.aside
        return loaded.entries

    def _due(self, *, ended: bool) -> bool:
        now_s = self._clock()
        if ended:
            return self.persisted_revision < self._revision or self._counted
        if self._problem and now_s - self._failed_s < RETRY_S:
            return False
        return self.persisted_revision < self._revision or (self._counted and now_s - self._written_s >= COUNTERS_S)

    def _write(self) -> None:
        stamp = self._stamp()
        with self._lock:
            revision, table, self._counted = self._revision, dict(self._table), False
            self._later_s = None
            changed = {place for place, put in table.items() if self._gists.get(place) != put.gist}
            self._disk = {
                place: one for place, one in self._disk.items() if one.running is table[place].persisted.running
            }
        entries = [
            Entry(place, put.persisted.aged(max(stamp.clock_s - put.at_s, 0.0)), put.run)
            for place, put in table.items()
        ]
        try:
            self._ownership.take(lambda: self._ended)
            move_aside(self._directory, self._aside, "unread")
            self._aside = ()
            replace_file(self.path, encode(stamp, self._run_number, entries))
            if not self.persisted_revision:  # an older version started again then finds nothing, and holds every bay
                move_aside(self._directory, [FIRST_FILE], "old")
        except OSError as error:
            self._fail(_said(error, self.path), stamp.clock_s)
            if isinstance(error, FileNotFoundError):
                self._ownership.give_up()  # somebody has removed the directory with its lock: lock it again
            return
        with self._lock:
            self._disk = {place: put.persisted for place, put in table.items()}
            self._gists = {place: put.gist for place, put in table.items()}
            self.persisted_revision, self._pending_s = revision, self._later_s
            self._problem, self._written_s = None, stamp.clock_s
        self._on_persisted(changed)

    def _fail(self, problem: Cause, now_s: float) -> None:
        self._problem, self._failed_s, self._counted = problem, now_s, True

    def _stamp(self) -> Stamp:
        return Stamp(self._wall(), self._clock(), self._boot)


def _said(error: OSError, path: Path) -> Cause:
    return Cause.of("disk_failed", file=str(error.filename or path), error=code_of(error))
