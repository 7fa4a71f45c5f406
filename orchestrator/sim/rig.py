"""One bay of the emulated station: a battery and a charger, and both of their lines."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.model import ControlMode
from orchestrator.sim.bay import Bay
from orchestrator.sim.bmu import Bmu, Layout
from orchestrator.sim.can_wire import CanWire
from orchestrator.sim.charger_wire import ChargerWire
from orchestrator.sim.line import Line
from orchestrator.sim.pack import Readout

#: A model that was advanced this recently is not advanced again for a question.
FRESH_S = 0.005


@dataclass(slots=True)
class Setup:
    """How a rig is wired."""

    node_id: int
    link: Path | None = None  #: a name for the charger's port
    line: Line = field(default_factory=Line)
    layout: Layout = Layout.FIRST_HIGH
    main_loop: bool = False  #: the BMU answers when its main loop comes round to it
    speed: float = 1.0  #: model seconds in one real second


@dataclass(frozen=True, slots=True)
class AsBuilt:
    """What a fault may change and healing brings back."""

    control_mode: ControlMode
    ambient_c: float
    cells: int = 13


class Rig:
    """A bay of the model with its charger on a pty and its BMU on a bus. Belongs to the loop's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, can_wire: CanWire, bay: Bay, setup: Setup) -> None:
        self.bay = bay
        self.as_built = AsBuilt(bay.charger.control_mode, bay.pack.ambient_c, bay.pack.cells)
        self.injected_s: float | None = None  #: when the newest fault was injected, `time.monotonic()`
        self._loop = loop
        self._speed = setup.speed
        self._advanced_s = loop.time()
        self.wire = ChargerWire(loop, bay.charger, line=setup.line, link=setup.link, now=self.catch_up)
        self.bmu = Bmu(loop, can_wire, setup.node_id, self._readout, layout=setup.layout, main_loop=setup.main_loop)
        self.wire.open()

    def catch_up(self) -> None:
        """Let the model's time pass until now."""
        now_s = self._loop.time()
        if now_s - self._advanced_s >= FRESH_S:
            self.bay.advance((now_s - self._advanced_s) * self._speed)
            self._advanced_s = now_s

    def inject(self, fault: Callable[["Rig"], None]) -> float:
        """Let a fault happen; returns the moment, from which the first stop frame is waited for."""
        self.catch_up()
        fault(self)
        self.bay.advance(0.001)  # what the fault changes is there at once
        self.wire.counters.mark()
        self.injected_s = self._loop.time()
        return self.injected_s

    def later(self, seconds: float, act: Callable[[], object]) -> None:
        """Let something happen after a while."""
        self._loop.call_later(seconds, act)

    def close(self) -> None:
        """Both devices vanish."""
        self.wire.close()
        self.bmu.close()

    def _readout(self) -> Readout:
        self.catch_up()
        return self.bay.readout()


def cross_cables(one: Rig, other: Rig) -> None:
    """Swap the serial cables of two bays: what is ordered for one is done by the charger of the other."""
    one.wire.charger, other.wire.charger = other.wire.charger, one.wire.charger
