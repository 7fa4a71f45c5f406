"""The running service: one thread a serial port, one a CAN bus, and this loop, which wakes on every new reading.

Theory of operation. Devices replace their view and put their bay's number into a queue; the loop takes a step for every
bay that has news, and for every bay at least each TICK_S, so that what did *not* come is noticed, too. The queue is the
only thing that the loop waits for. Signals only put into it. At the end every bay is stopped and verified.
"""

import signal
from collections.abc import Callable, Mapping
from functools import partial
from queue import Empty, SimpleQueue
from time import CLOCK_BOOTTIME, clock_gettime, monotonic, time
from types import FrameType

from orchestrator.config.station import Bay, Rs485, Station
from orchestrator.devices.battery import BatteryNode
from orchestrator.devices.bus import BatteryBus
from orchestrator.devices.bus_budget import BusBudget
from orchestrator.devices.charger import ChargerPort
from orchestrator.errors import ServiceError
from orchestrator.link.can import CanBus, load
from orchestrator.link.gpio import OutputLine, need_gpiod
from orchestrator.link.serial import SerialLine
from orchestrator.model import Request
from orchestrator.service.answers import Answer, Later
from orchestrator.service.bay import TICK_S, Asked, BayRunner
from orchestrator.service.contactor import Contactor
from orchestrator.service.control import ControlSocket
from orchestrator.service.guarded import GuardedLine, GuardedOutput, GuardianLink
from orchestrator.service.journal import Journal
from orchestrator.service.kept import read_kept
from orchestrator.service.reload import Reload
from orchestrator.service.status import station_status

#: How often the guardian hears that every loop turns: five times before it acts.
BEAT_S = 0.1
#: How long the end of the service waits for every charger to be verified.
STOP_S = 3.0
#: An operator's request is answered by the next step; longer than this means that the loop hangs.
ANSWER_S = 2.0


class Supervisor:
    """The service for one station. `run` returns when the service was told to end."""

    def __init__(self, station: Station, guardian: GuardianLink) -> None:
        self._station = station
        self._guardian = guardian
        self._beat_s = 0.0
        self._lost = ""  # why the guardian cannot be relied on any more
        self._wake: SimpleQueue[int | None] = SimpleQueue()
        self._ending = ""
        self._journal = Journal(station.journal.directory, station.journal.max_mb, monotonic, time)
        self._ports: list[ChargerPort] = []
        self._buses: list[BatteryBus] = []
        self._bays: list[BayRunner] = []
        self._build()
        self._reload = Reload(station, self._bays, self._journal.say)
        self._reload_asked = False
        self._control = ControlSocket(station.control.socket, self._answer, monotonic, self._journal.say)

    def _build(self) -> None:
        """Devices for every bay; nothing is opened yet."""
        nodes: dict[str, list[BatteryNode]] = {name: [] for name in self._station.can}
        buses = {
            name: CanBus(name, settings, [bay.battery.node_id for bay in self._station.bays if bay.battery.can == name])
            for name, settings in self._station.can.items()
        }
        budgets = {name: BusBudget(bus.bitrate) for name, bus in buses.items()}
        kept = read_kept(self._station.journal.directory, [bay.name for bay in self._station.bays])
        for number, bay in enumerate(self._station.bays):
            poke: Callable[[], None] = partial(self._wake.put, number)
            port = _charger_port(bay, poke, self._guardian)
            node = BatteryNode(bay.battery.can, bay.battery, budgets[bay.battery.can], poke)
            nodes[bay.battery.can].append(node)
            self._ports.append(port)
            contactor, memory = _contactor(bay, self._guardian), kept[bay.name].memory(monotonic())
            snapshots = self._station.journal.snapshots
            self._bays.append(
                BayRunner(bay, port, node, self._journal, memory, contactor=contactor, snapshots=snapshots)
            )
        self._buses = [BatteryBus(bus, nodes[name], monotonic) for name, bus in buses.items() if nodes[name]]

    @property
    def _devices(self) -> tuple[ChargerPort | BatteryBus, ...]:
        return (*self._ports, *self._buses)

    def run(self) -> int:
        """Run until SIGTERM or SIGINT; 0 if every charger was then verified to stand by, else 1. SIGHUP: `Reload`.

        Without its guardian it ends, too, and with 1.
        """
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)
        signal.signal(signal.SIGHUP, self._on_hangup)
        self._journal.start()
        self._control.start()
        for port in self._ports:
            port.start()
        load()  # the ports are stopping their chargers meanwhile; the first heartbeat comes when it is done
        for bus in self._buses:
            bus.start()
        self._journal.say(
            f"{self._station.station}: {len(self._bays)} bays, control socket {self._station.control.socket}"
        )
        while not self._ending:
            self._turn()
        self._journal.say(f"{self._ending}: stopping every bay")
        return self._end()

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._ending = self._ending or signal.Signals(number).name
        self._wake.put(None)

    def _on_hangup(self, _number: int, _frame: FrameType | None) -> None:
        self._reload_asked = True
        self._wake.put(None)

    def _turn(self) -> None:
        """Wait for news, then step the bays that have some, and those that have been left alone for a tick."""
        for number in self._news():
            self._run(self._bays[number])
        if self._reload_asked:
            self._reload_asked = False
            self._reload.ask()
        now_s = monotonic()
        for bay in self._bays:
            if now_s - bay.last_s >= TICK_S:
                self._run(bay)
        if now_s - self._beat_s >= BEAT_S:
            self._beat(now_s)

    def _run(self, bay: BayRunner) -> None:
        now_s = monotonic()
        bay.run(now_s, boottime() - now_s)

    def _beat(self, now_s: float) -> None:
        """Let the guardian know that every loop turns; without it, end."""
        workers = (*self._devices, self._control, self._journal)
        well = not any(worker.stalled(now_s) for worker in workers)
        self._beat_s = now_s
        self._lost = self._guardian.beat(now_s, well=well)
        self._ending = self._ending or self._lost

    def _news(self) -> set[int]:
        numbers: set[int | None] = set()
        try:
            numbers.add(self._wake.get(timeout=BEAT_S / 2))
            while True:
                numbers.add(self._wake.get_nowait())
        except Empty:
            return {number for number in numbers if number is not None}

    def _end(self) -> int:
        """Stop every bay, wait until each charger is verified, close everything."""
        for bay in self._bays:
            bay.end(self._ending, orderly=not self._lost)
        end_s = monotonic() + STOP_S
        for bay in self._bays:
            self._run(bay)
        while monotonic() < end_s and not all(bay.verified for bay in self._bays):
            self._turn()
        unverified = [bay.name for bay in self._bays if not bay.verified]
        for bay in self._bays:
            bay.isolate()
        self._guardian.done()
        self._control.close()
        for worker in self._devices:
            worker.close()
        verdict = f"NOT verified: {', '.join(unverified)}" if unverified else "every charger stands by, verified"
        self._journal.say(f"ended: {verdict}")
        self._journal.close()
        return 1 if unverified or self._lost else 0

    # --- what the control socket asks, in its own thread ---

    def _answer(self, request: Mapping[str, object]) -> Answer | Later:
        verb = request.get("verb")
        if verb == "status":
            name = request.get("bay")
            bays = self._bays if name is None else [self._named(name)]
            return station_status(self._station, [bay.status() for bay in bays], self._journal.problem(monotonic()))
        if isinstance(verb, str) and verb in set(Request):
            names = request.get("bays")
            bays = self._bays if names is None else [self._named(name) for name in _names(names)]
            return self._ask(list(dict.fromkeys(bays)), Request(verb))
        raise ServiceError(f"unknown verb {verb!r}: status, {', '.join(Request)}")

    def _named(self, name: object) -> BayRunner:
        for bay in self._bays:
            if bay.name == name:
                return bay
        raise ServiceError(f"no bay {name!r} here: {', '.join(bay.name for bay in self._bays)}")

    def _ask(self, bays: list[BayRunner], request: Request) -> Later:
        """Hand the request to each bay; what they say is there later, "" is yes."""
        asked = {bay.name: Asked(request) for bay in bays}
        for bay in bays:
            bay.ask(asked[bay.name])
            self._wake.put(self._bays.index(bay))
        end_s = monotonic() + ANSWER_S
        late = "the control loop has not answered: look at the service's log"

        def results() -> Answer | None:
            if not all(one.done.is_set() for one in asked.values()) and monotonic() < end_s:
                return None
            return {"results": {name: one.answer if one.done.is_set() else late for name, one in asked.items()}}

        return results


def boottime() -> float:
    """As `monotonic`, but it goes on while the machine is suspended."""
    return clock_gettime(CLOCK_BOOTTIME)


def _names(value: object) -> list[object]:
    if not isinstance(value, list):
        raise ServiceError("'bays' is a list of names, or null for all")
    return value


def _charger_port(bay: Bay, poke: Callable[[], None], guardian: GuardianLink) -> ChargerPort:
    port, kernel = bay.charger.port, bay.charger.rs485 is Rs485.KERNEL
    return ChargerPort(
        bay.charger,
        bay.limits,
        open_line=partial(GuardedLine, port, partial(SerialLine.open, port, kernel_rs485=kernel), guardian),
        clock=monotonic,
        on_change=poke,
    )


def _contactor(bay: Bay, guardian: GuardianLink) -> Contactor | None:
    """The bay's contactor, if it has one. LinkError where the library for it is not installed."""
    config = bay.contactor
    if config is None:
        return None
    need_gpiod()
    open_output = partial(OutputLine.open, config.chip, config.line, active_low=config.active_low)
    return Contactor(partial(GuardedOutput, bay.name, open_output, guardian))
