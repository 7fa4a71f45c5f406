"""The whole controller in virtual time: the unchanged supervisor, ports, buses, pyserial and core on emulated bays.

It replaces the kernel below (ttys, the CAN driver, clock, threads) and what surrounds the chargers: the journal's disk,
the control socket and the guardian. `Service.run` ends like the process: by a signal, with every bay stopped.
"""

import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import serial.serialposix
import serial.serialutil
from durand.scheduler import get_scheduler, set_scheduler  # type: ignore[import-untyped]  # it has no annotations

from orchestrator.config.load import load_map, load_policy
from orchestrator.config.policy import Policy
from orchestrator.config.station import (
    BatteryConfig,
    BayConfig,
    ChargerConfig,
    ContactorConfig,
    Control,
    JournalConfig,
    Limits,
    Station,
)
from orchestrator.core.memory import Memory
from orchestrator.core.persisted import Persisted
from orchestrator.devices import bus as bus_module
from orchestrator.devices import charger as charger_module
from orchestrator.keys import Range
from orchestrator.lastresort import line_settings as settings_module
from orchestrator.link import can as can_module
from orchestrator.link import serial as serial_module
from orchestrator.model import Cause, ControlMode, Decision, Request
from orchestrator.service import asked as asked_module
from orchestrator.service import ports as ports_module
from orchestrator.service import reload as reload_module
from orchestrator.service import sockets as sockets_module
from orchestrator.service import supervisor as supervisor_module
from orchestrator.service import supply as supply_module
from orchestrator.service import wiring as wiring_module
from orchestrator.service.asked import Asked
from orchestrator.service.bay import BayRunner
from orchestrator.service.past import Place
from orchestrator.service.ports import ChargerPorts
from orchestrator.service.supervisor import Supervisor
from orchestrator.sim.can_noise import Bus
from orchestrator.sim.can_wire import PERFECT
from tests.proof.virtual_can import BusWire, Driver
from tests.proof.virtual_kernel import Kernel
from tests.proof.virtual_rig import Nature, VirtualRig
from tests.proof.virtual_threads import Event, SimpleQueue, Thread
from tests.proof.virtual_time import Time

STEPS_A = (2.0, 5.0, 8.0, 11.0, 14.0)
FIRST_NODE = 0x10
#: Of the real signals only the names: a world is ended by `World.end`.
SIGNALS = SimpleNamespace(
    signal=lambda *_: None, pthread_sigmask=lambda *_: None, SIG_BLOCK=0, SIG_UNBLOCK=1,
    SIGTERM=15, SIGINT=2, SIGHUP=1, Signals=signal.Signals,
)  # fmt: skip


class Guardian:
    """Answers every heartbeat; `unwell` are heartbeats the real guardian would not have got."""

    unwell = 0

    def beat(self, _now_s: float, *, well: bool = True) -> None:
        self.unwell += not well

    def hold(self, _port: str, _fd: int) -> None:
        """As the real one."""

    def drop(self, _port: str) -> None:
        """As the real one."""

    def hold_contactor(self, _name: str, _fd: int | None) -> None:
        """As the real one."""

    def done(self) -> None:
        """As the real one."""


class Contactor:
    """A bay's GPIO line and its contactor: while open, the charger sees no battery. Nothing else is in the cable."""

    def __init__(self, rig: VirtualRig) -> None:
        self._rig = rig
        self.drive(closed=False)

    def drive(self, *, closed: bool) -> None:
        self._rig.catch_up(force=True)
        self._rig.bay.connected = closed

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        """The line keeps its level."""


class Notebook:
    """A journal read at once."""

    def __init__(self, *_: object, **__: object) -> None:
        self.said: list[str] = []
        self.lines: list[tuple[str, Any]] = []

    def start(self) -> None:
        """No disk, no thread."""

    def close(self, *_: object) -> None:
        """Nothing is left to write."""

    def stalled(self, _now_s: float) -> bool:
        return False

    def say(self, text: str) -> None:
        self.said.append(text)

    def note(self, cause: Cause, language: str) -> None:
        """What the service says of itself, nobody reads here."""

    def put(self, bay: str, line: Any, t_s: float | None = None) -> None:
        if line[0] == "fault":
            self.lines.append((bay, line[1]))


class Shelf:
    """A store on an instantaneous disk. `memories` are those of the last run, by bay name."""

    persisted_revision = 0

    def __init__(self, memories: Mapping[str, Memory], *_: object, **__: object) -> None:
        self._memories = memories
        self.persisted: dict[str, Persisted] = {}

    def start(self) -> None:
        """No disk, no thread."""

    def wait(self, _within_s: float) -> bool:
        return True

    def past(self, place: Place) -> "_Past":
        return _Past(self._memories.get(place.bay, Memory()))

    def strays(self) -> list[Place]:
        return []

    def put(self, place: Place, persisted: Persisted) -> int:
        self.persisted[place.bay] = persisted
        return self.persisted_revision

    def on_disk(self, place: Place) -> Persisted | None:
        return self.persisted.get(place.bay)

    def not_persisted(self, _now_s: float) -> None:
        """It takes everything."""

    def stalled(self, _now_s: float) -> bool:
        return False

    def close(self, _within_s: float) -> None:
        """Nothing is left to be written."""


class Silence:
    """A control socket that nobody uses."""

    def __init__(self, *_: object, **__: object) -> None:
        """Any argument."""

    def start(self) -> None:
        """Nobody comes."""

    close = start

    def stalled(self, _now_s: float) -> bool:
        return False


class Watching(Silence):
    """The readers of its status: there are none."""

    def take(self, client: object) -> None:
        """Nobody comes here, either."""


def station(
    controls: Sequence[ControlMode],
    policies: Sequence[Policy] = (),
    limit_a: float = 15.0,
    *,
    contactors: bool = False,
    **battery: Any,
) -> Station:
    """A standard test bay for each control mode, on one bus; li-ion-48v where no other policy is given."""
    settings = {"can": "can0", "map": load_map("tabos"), **battery}
    chosen = policies or [load_policy("li-ion-48v")] * len(controls)
    return Station(
        station="virtual",
        can={"can0": {"interface": "virtual", "bitrate": 250_000}},
        bays=tuple(
            BayConfig(
                name=f"bay-{number + 1}",
                charger=ChargerConfig(port=f"/virtual/{number + 1}", control=control, steps_a=STEPS_A),
                battery=BatteryConfig(node_id=FIRST_NODE + number, **settings),
                limits=Limits(voltage_v=58.4, current_a=limit_a, temperature_c=Range(0, 45)),
                policy=policy,
                contactor=ContactorConfig(chip="/virtual/gpiochip", line=number) if contactors else None,
            )
            for number, (control, policy) in enumerate(zip(controls, chosen, strict=True))
        ),
        control=Control(socket=Path("/virtual/socket")),
        journal=JournalConfig(directory=Path("/virtual/journal"), snapshots=False),
    )


class World:
    """A station, its emulated bays, and the service on it. Make it by `world()`."""

    def __init__(
        self, time: Time, the_station: Station, natures: Sequence[Nature], kept: Mapping[str, Memory], bus: Bus
    ) -> None:
        self.time = time
        self._patches = ExitStack()
        self._patches.callback(set_scheduler, get_scheduler())  # the emulated BMUs put this world's in its place
        self.kernel = Kernel(time)
        self.bus = BusWire(time, self.kernel.calls, bus)
        self.rigs = [
            VirtualRig(time, self.bus, self.kernel.add(bay.charger.port), bay.battery.node_id, nature)
            for bay, nature in zip(the_station.bays, natures, strict=True)
        ]
        self._station = the_station
        self._kept = kept
        self._patch()
        self.guardian = Guardian()
        self._ports = ChargerPorts(the_station, self.guardian)  # type: ignore[arg-type]  # as the real one
        self.supervisor = Supervisor(the_station, self.guardian, self._ports)  # type: ignore[arg-type]  # as above
        self.on_step: Callable[[BayRunner], None] = lambda _: None
        self._watch_steps()

    @property
    def bays(self) -> list[BayRunner]:
        return self.supervisor._bays

    @property
    def journal(self) -> Notebook:
        return self.supervisor._journal  # type: ignore[return-value]  # it was put there by `_patch`

    @property
    def console(self) -> Notebook:
        return self.supervisor._console  # type: ignore[return-value]  # it, too

    @property
    def store(self) -> Shelf:
        return self.supervisor._store  # type: ignore[return-value]  # it, too

    def decision(self, bay: int = 0) -> Decision:
        decision = self.bays[bay].decision
        assert decision is not None
        return decision

    def ask(self, request: Request, bay: int = 0) -> Asked:
        """As the control socket would."""
        asked = Asked(request)
        self.bays[bay].ask(asked)
        self.supervisor._wake.put(bay)
        return asked

    def end(self) -> None:
        self.supervisor._on_signal(signal.SIGTERM, None)

    def run(self) -> int:
        """Run until it ends; returns the exit status. Raises whatever breaks the world."""
        try:
            self._ports.start()
            return self.supervisor.run()
        except BaseException:
            if self.time.failure is not None:
                raise self.time.failure from None
            raise

    def close(self) -> None:
        try:
            self.time.close()
        finally:
            self._patches.close()

    def _watch_steps(self) -> None:
        for bay in self.bays:
            take = bay._step

            def watched(
                now_s: float, asleep_s: float, request: Request | None, bay: BayRunner = bay, take: Any = take
            ) -> None:
                take(now_s, asleep_s, request)
                self.on_step(bay)

            bay._step = watched  # type: ignore[method-assign]  # whoever watches sees every step

    def _patch(self) -> None:
        time = self.time
        event, thread = partial(Event, time), partial(Thread, time)
        fake = self.kernel.modules()
        change = self._patches.enter_context
        replaced: dict[Any, dict[str, Any]] = {
            wiring_module: {
                "OutputLine": SimpleNamespace(open=lambda _chip, line, **_: Contactor(self.rigs[line])),
            },
            ports_module: {"monotonic": time.clock, "SimpleQueue": _Queues(time), "signal": SIGNALS},
            supervisor_module: {
                "monotonic": time.clock, "boottime": time.clock,
                "Journal": Notebook, "Console": Notebook,
                "Store": partial(Shelf, self._kept), "boot_id": lambda: "virtual", "close_all": _close_all,
                "signal": SIGNALS,
            },
            sockets_module: {"monotonic": time.clock, "ControlSocket": Silence, "Streams": Watching},
            asked_module: {"Event": event},
            supply_module: {"monotonic": time.clock},
            reload_module: {"threading": SimpleNamespace(Event=event, Thread=thread)},
            charger_module: {"Event": event, "Thread": thread},
            bus_module: {"threading": SimpleNamespace(Event=event, Thread=thread)},
            serial_module: {
                "time": SimpleNamespace(sleep=self._sleep),
                **{name: fake[name] for name in ("select", "os", "fcntl")},
            },
            settings_module: {name: fake[name] for name in ("termios", "fcntl")},
            can_module: {"_open_bus": lambda _: Driver(self.bus, time)},
            serial.serialposix: fake,
            serial.serialutil.Timeout: {"TIME": time.clock},
        }  # fmt: skip
        for module, names in replaced.items():
            for name, value in names.items():
                change(patch.object(module, name, value))

    def _sleep(self, seconds: float) -> None:
        self.time.wait(self.time.now_s + seconds)


class _Queues:
    """`SimpleQueue`, `SimpleQueue[int]` and `SimpleQueue()`."""

    def __init__(self, time: Time) -> None:
        self._time = time

    def __getitem__(self, _: object) -> "_Queues":
        return self

    def __call__(self) -> SimpleQueue[Any]:
        return SimpleQueue(self._time)


def _close_all(closings: Iterable[Callable[[], object]], _within_s: float) -> bool:
    """One after another: nothing hangs here."""
    for close in closings:
        close()
    return True


class _Past:
    """The state persisted by the last run, as a hand-made memory."""

    typed, timed = "", None  #: nobody has named a battery, or asked for a start at a time of day

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def memory(self, _now_s: float) -> Memory:
        return self._memory


@contextmanager
def world(
    the_station: Station,
    natures: Sequence[Nature],
    *,
    end_s: float = 600.0,
    kept: Mapping[str, Memory] | None = None,
    bus: Bus = PERFECT,
) -> Iterator[World]:
    """A world that is always taken down completely; it ends at `end_s` if nothing ends it before."""
    made = World(Time(end_s), the_station, natures, kept or {}, bus)
    try:
        yield made
    finally:
        made.close()
