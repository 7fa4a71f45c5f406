"""The running service: one thread per serial port, one per CAN bus, and this loop, which wakes on every new reading.

Theory of operation. Devices replace their view, and if that is news that cannot wait, their thread puts the bay into a
queue: waking the loop costs more than looking. The loop makes a decision for every bay with news, and for every bay at
least once a tick, so that *missing* readings are noticed as well; news goes before ticks. The loop waits only for the
queue, and signals only put into it. At the end every bay is stopped and verified.
"""

import signal
from collections.abc import Callable, Collection, Iterable
from functools import partial
from queue import Empty
from time import monotonic, time
from types import FrameType

from orchestrator.config.station import Station
from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus import BatteryBus
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.devices.charger import ChargerPort
from orchestrator.model import Cause
from orchestrator.model.moment import moment
from orchestrator.service.bay import BayRunner
from orchestrator.service.bayrecord import BayRecord
from orchestrator.service.boot import boot_id, boottime
from orchestrator.service.closing import close_all
from orchestrator.service.console import Console
from orchestrator.service.guarded import GuardianLink
from orchestrator.service.journal import Journal
from orchestrator.service.past import Place
from orchestrator.service.ports import REQUESTS, ChargerPorts
from orchestrator.service.reload import Reload
from orchestrator.service.sockets import Sockets
from orchestrator.service.starts import Starts
from orchestrator.service.store import Store
from orchestrator.service.strays import Strays
from orchestrator.service.supply import Feeds
from orchestrator.service.wiring import can_buses, open_contactor, recorder, stray_port
from orchestrator.text.catalogue import say

#: The heartbeat period: the guardian acts after five missed ones.
BEAT_S = 0.1
#: How long the end of the service waits for every charger to be verified.
STOP_S = 3.0
#: A working disk delivers the persisted state within this; otherwise journal and control socket start meanwhile …
LOCK_S = 0.3
#: … and it has this long.
LOAD_S = 3.0
#: The time limits at the end: closing the control socket, writing changes, closing everything else, and the records.
CONTROL_S, KEEP_S, CLOSE_S, RECORDS_S = 0.2, 2.5, 2.5, 1.0


class Supervisor:
    """The service for one station. `run` returns when the service is told to end.

    `ports` have already been started: stopping the chargers does not wait for any of this.
    """

    def __init__(self, station: Station, guardian: GuardianLink, ports: ChargerPorts) -> None:
        self._station, self._language = station, station.language.value
        self._guardian, self._beat_s = guardian, 0.0
        self._lost: Cause | None = None  # why the guardian cannot be relied on any more
        self._unable: Cause | None = None  # why it could not begin
        self._ports, self._wake = ports.all, ports.news
        self._ending: Cause | None = None
        boot, kept = boot_id(), station.journal
        self._console = Console(language=self._language)
        self._journal = Journal(kept.directory, kept.max_mb, monotonic, time, boot=boot, say=self._say)
        places = [Place.of(bay) for bay in station.bays]
        self._store = Store(kept.directory, places, monotonic, time, boot=boot, on_persisted=self._on_persisted)
        self._recorder = recorder(kept, boot, self._say)
        self._bays: list[BayRunner] = []
        self._build(ports)
        stray = partial(stray_port, self._guardian, partial(self._wake.put, None))
        self._strays = Strays(self._store, stray, self._say)
        self._reload, self._reload_asked = Reload(station, self._bays, self._say), False
        self._sockets = Sockets(
            station, self._bays, self._journal, self._store, self._strays, self._feeds, self._reload,
            self._wake.put, self._say,
        )  # fmt: skip

    def _build(self, ports: ChargerPorts) -> None:
        """Create the devices for every bay; nothing is opened yet."""
        nodes: dict[str, list[BatteryNode]] = {name: [] for name in self._station.can}
        buses = can_buses(self._station)
        budgets = {name: BusBudget(bus.bitrate) for name, bus in buses.items()}
        alone, self._feeds = len(self._station.bays) == 1, Feeds.of(self._station, self._say)
        starts = Starts(0.0 if alone else self._station.stagger_s, self._station.source.at("stagger_s"))
        for number, (bay, port) in enumerate(zip(self._station.bays, self._ports, strict=True)):
            poke: Callable[[], None] = partial(self._changed, number)
            node = BatteryNode(bay.battery.can, bay.battery, budgets[bay.battery.can], poke)
            nodes[bay.battery.can].append(node)
            contactor, snapshots = open_contactor(bay, self._guardian), self._station.journal.snapshots
            runner = BayRunner(
                bay, port, node, self._journal, self._store, self._say,
                contactor=contactor, starts=starts, snapshots=snapshots, language=self._language,
                feed=self._feeds.feeds[number], record=BayRecord(self._recorder, self._station.station, bay),
            )  # fmt: skip
            self._bays.append(runner)
        ports.changed = self._changed
        self._buses = [
            BatteryBus(bus, nodes[name], budgets[name], monotonic) for name, bus in buses.items() if nodes[name]
        ]

    def run(self) -> int:
        """Run until SIGTERM or SIGINT; returns 0 if every charger was then verified in standby, else 1.

        Without its guardian it ends, too, and with 1. Raises StartError where another service owns the journal.
        """
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)
        signal.signal(signal.SIGHUP, self._on_hangup)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, REQUESTS)
        try:
            try:
                self._begin()
            except (RuntimeError, MemoryError, OSError) as error:  # no thread to be had, say; but the ports have theirs
                self._unable = Cause.of("unable", error=str(error) or repr(error))
                self._ending = self._ending or self._unable
            while self._ending is None:
                self._turn()
            self._say(Cause.of("ending", why=self._ending))
            return self._end(self._ending)
        finally:
            self._console.close()

    def _begin(self) -> None:
        """Read the persisted state, and make every bay's first decision. The ports stop their chargers meanwhile."""
        self._store.start()
        if known := self._store.wait(LOCK_S):
            self._strays.begin()
        self._console.start()
        self._journal.start()
        self._recorder.start()
        self._reload.start()
        self._sockets.start()
        if not known and self._store.wait(LOAD_S):
            self._strays.begin()
        for bus in self._buses:
            bus.start()
        socket = str(self._station.control.socket)
        self._say(Cause.of("service_begins", station=self._station.station, bays=len(self._bays), socket=socket))
        self._run_all()

    def _say(self, cause: Cause) -> None:
        """A line on standard error; the journal has it as well."""
        self._console.say(say(cause, self._language))
        self._journal.note(cause, self._language)

    def _run_all(self) -> None:
        for bay in self._bays:
            self._run(bay)

    def _changed(self, number: int) -> None:
        """A device of this bay has something new, in its thread."""
        if self._bays[number].has_news():
            self._wake.put(number)

    def _on_persisted(self, places: Collection[Place]) -> None:
        """A change on disk may let a charge begin, or answer a request."""
        for number, bay in enumerate(self._bays):
            if bay.place in places:
                self._wake.put(number)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._ending = self._ending or Cause.of("signal", name=signal.Signals(number).name)
        self._wake.put(None)

    def _on_hangup(self, _number: int, _frame: FrameType | None) -> None:
        self._reload_asked = True
        self._wake.put(None)

    def _turn(self) -> None:
        """Wait for news, then decide the bays for which it matters, and those without a decision for a tick."""
        self._decide(self._news(BEAT_S / 2))
        if self._reload_asked:
            self._reload_asked = False
            self._reload.ask()
        now_s = monotonic()
        for bay in self._bays:
            if bay.is_due(now_s):
                self._run(bay)
                self._decide(self._news())
        for number in self._feeds.turn(now_s):
            self._run(self._bays[number])
        if now_s - self._beat_s >= BEAT_S:
            self._strays.look(now_s)
            self._beat(now_s)

    def _decide(self, numbers: Iterable[int]) -> None:
        """Decide these bays, unless that has been done meanwhile."""
        for number in numbers:
            if self._bays[number].has_news():
                self._run(self._bays[number])

    def _run(self, bay: BayRunner) -> None:
        now_s = monotonic()
        asleep_s, at_s = boottime() - now_s, moment(now_s)
        bay.run(at_s if at_s > bay.last_s else now_s, asleep_s)  # two decisions of a bay never have the same time

    def _beat(self, now_s: float) -> None:
        """Tell the guardian that every loop makes progress; end if the guardian is gone."""
        devices: tuple[ChargerPort | BatteryBus, ...] = (*self._ports, *self._buses)
        writers = (self._journal, self._recorder, self._store)
        well = not any(worker.stalled(now_s) for worker in (*devices, self._sockets, *writers))
        self._beat_s = now_s
        self._lost = self._guardian.beat(now_s, well=well)
        self._ending = self._ending or self._lost

    def _news(self, timeout_s: float = 0.0) -> set[int]:
        """The bays with news; waits at most so long for the first."""
        numbers: set[int | None] = set()
        try:
            if timeout_s:
                numbers.add(self._wake.get(timeout=timeout_s))
            while True:
                numbers.add(self._wake.get_nowait())
        except Empty:
            return {number for number in numbers if number is not None}

    def _end(self, why: Cause) -> int:
        """Stop every bay, wait until each charger is verified, close everything."""
        for bay in self._bays:
            bay.end(why, orderly=self._lost is None)
        end_s = monotonic() + STOP_S
        self._run_all()
        while monotonic() < end_s and (self._unverified() or any(bay.owes for bay in self._bays)):
            self._turn()
        close_all([self._sockets.close], CONTROL_S)  # no request is *accepted* from now on …
        self._run_all()  # … and earlier ones are handled
        unverified = self._unverified()
        for bay in self._bays:
            bay.isolate()
        self._guardian.done()
        not_persisted = self._store.close(KEEP_S)
        for bay in self._bays:
            bay.answer()
        devices: tuple[ChargerPort | BatteryBus, ...] = (*self._ports, *self._strays.ports, *self._buses)
        close_all([one.close for one in devices], CLOSE_S)
        verdicts = [Cause.of("not_verified", chargers=tuple(unverified))] if unverified else []
        verdicts += [Cause.of("not_written", problem=not_persisted)] if not_persisted is not None else []
        self._say(Cause.of("ended", verdicts=tuple(verdicts)) if verdicts else Cause("ended_well"))
        close_all([self._journal.close, self._recorder.close], RECORDS_S)
        return 1 if verdicts or self._lost or self._unable else 0

    def _unverified(self) -> list[str | Cause]:
        return [*(bay.name for bay in self._bays if not bay.verified), *self._strays.unverified]
