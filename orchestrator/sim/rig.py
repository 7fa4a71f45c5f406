"""One bay of the emulated station: a battery, a charger, and both of their lines."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.model import ControlMode
from orchestrator.sim.bay import SimulatedBay
from orchestrator.sim.bmu import Bmu, Layout
from orchestrator.sim.can_wire import CanWire
from orchestrator.sim.charger_wire import ChargerWire
from orchestrator.sim.line import SimulatedLine
from orchestrator.sim.pack import Readout

#: A model advanced this recently is not advanced again for a query.
FRESH_S = 0.005


@dataclass(slots=True)
class Setup:
    """How a rig is wired."""

    node_id: int
    link: Path | None = None  #: a name for the charger's port
    line: SimulatedLine = field(default_factory=SimulatedLine)
    layout: Layout = Layout.FIRST_HIGH
    main_loop: bool = False  #: the BMU answers when its main loop gets to it
    serial: int = 0  #: the battery's serial number; 0: it has none
    speed: float = 1.0  #: model seconds per real second


@dataclass(frozen=True, slots=True)
class AsBuilt:
    """Values that a fault may change and that healing restores."""

    control_mode: ControlMode
    ambient_c: float
    cells: int = 13


class Rig:
    """A bay of the model with its charger on a pty and its BMU on a bus. Belongs to the loop's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, can_wire: CanWire, bay: SimulatedBay, setup: Setup) -> None:
        self.bay = bay
        self.as_built = AsBuilt(bay.charger.control_mode, bay.pack.ambient_c, bay.pack.cells)
        self.injected_s: float | None = None  #: when the newest fault was injected, `time.monotonic()`
        self._loop = loop
        self._speed = setup.speed
        self._advanced_s = loop.time()
        self.wire = ChargerWire(loop, bay.charger, line=setup.line, link=setup.link, now=self.catch_up)
        self.bmu = Bmu(
            loop, can_wire, setup.node_id, self._readout,
            layout=setup.layout, main_loop=setup.main_loop, serial=setup.serial,
        )  # fmt: skip
        self.wire.open()

    def catch_up(self) -> None:
        """Advance the model to the present time."""
        now_s = self._loop.time()
        if now_s - self._advanced_s >= FRESH_S:
            self.bay.advance((now_s - self._advanced_s) * self._speed)
            self._advanced_s = now_s

    def inject(self, fault: Callable[["Rig"], None]) -> float:
        """Inject a fault; returns the time, from which on the first stop frame is awaited."""
        self.catch_up()
        fault(self)
        self.bay.advance(0.001)  # so that the fault takes effect at once
        self.wire.counters.mark()
        self.injected_s = self._loop.time()
        return self.injected_s

    def later(self, seconds: float, act: Callable[[], object]) -> None:
        """Call `act` after this many seconds."""
        self._loop.call_later(seconds, act)

    def close(self) -> None:
        """Both devices vanish."""
        self.wire.close()
        self.bmu.close()

    def _readout(self) -> Readout:
        self.catch_up()
        return self.bay.readout()


def cross_cables(one: Rig, other: Rig) -> None:
    """Swap the serial cables of two bays: the other bay's charger carries out each bay's commands."""
    one.wire.charger, other.wire.charger = other.wire.charger, one.wire.charger
