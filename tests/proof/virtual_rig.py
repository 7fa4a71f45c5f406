"""The emulated bays of `orchestrator.sim` in virtual time: same models, same bytes, no pty and no bus."""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any, cast

from durand.scheduler import AsyncScheduler, set_scheduler  # type: ignore[import-untyped]  # it has no annotations

from orchestrator.model import ChargeMode, ControlMode
from orchestrator.sim.bay import SimulatedBay
from orchestrator.sim.bmu import Bmu
from orchestrator.sim.charger import SimulatedCharger
from orchestrator.sim.charger_frames import Request
from orchestrator.sim.charger_wire import ChargerWire
from orchestrator.sim.line import LINES
from orchestrator.sim.pack import Pack, Readout
from orchestrator.sim.rig import FRESH_S, AsBuilt, Rig
from tests.proof.virtual_can import BusWire
from tests.proof.virtual_gpio import Breaker
from tests.proof.virtual_time import Time
from tests.proof.virtual_tty import Tty

#: A BMU's time for an answer.
ANSWER_S = 0.002


@dataclass(frozen=True, slots=True)
class Nature:
    """The parts of a bay."""

    pack: Pack
    control: ControlMode = ControlMode.MANUAL
    line: str = "real"
    seed: int = 1
    speed: float = 1.0  #: model seconds per second
    main_loop: bool = False  #: the BMU answers when its main loop gets to it
    running: bool = False  #: as left by the last service
    contactor: bool = False  #: between charger and battery


class CutBay(SimulatedBay):
    """A bay with a contactor in its cable, if it has one."""

    breaker: Breaker | None = None

    def advance(self, dt_s: float) -> None:
        plugged = self.connected
        self.connected = plugged and (self.breaker is None or self.breaker.closed)
        super().advance(dt_s)
        self.connected = plugged


class MemoryWire(ChargerWire):
    """The emulated charger's end of a virtual tty."""

    def __init__(self, time: Time, charger: SimulatedCharger, tty: Tty, line: Any, now: Any) -> None:
        super().__init__(cast("Any", time), charger, line=line, now=now)
        self._time, self._tty = time, tty
        self._plugged = False
        tty.listener = self._receive
        self.on_started: Callable[[float], None] = lambda _now_s: None  #: a frame switched the output on
        self.on_stranger: Callable[[bool], None] = lambda _ran: None  #: a foreign frame switched it on or off
        self.late_s: tuple[float, float] | None = None  #: time from the request's write to the complete answer
        self.pieces = 1  #: number of pieces of an answer
        self._came_s = 0.0
        self._strange = False  #: the bytes heard now are another program's
        self._dice = Random(1)

    def open(self) -> None:
        self._plugged = True
        self._tty.plug()

    def close(self) -> None:
        self._plugged = False
        self._tty.unplug()
        self._ear.forget()

    @property
    def is_open(self) -> bool:
        return self._plugged

    @property
    def is_clear(self) -> bool:
        return self._tty.clear

    def set_speed(self, speed: int) -> None:
        self._tty.taken_over(speed)

    def lock(self) -> None:
        if self._tty.lock is None:
            self._tty.lock = self

    def unlock(self) -> None:
        if self._tty.lock is self:
            self._tty.lock = None

    def _receive(self, chunk: bytes) -> None:
        now_s = self._time.now_s
        if self.counters.first_byte_s is None:
            self.counters.first_byte_s = now_s
        if self.on_bytes is not None:
            self.on_bytes(now_s, chunk)
        if self._line.echo:
            self._write(chunk)
        if self.mute_rx:
            return
        if self._line.byte_s:
            self._time.call_later(len(chunk) * self._line.byte_s, self._hear, now_s, chunk)
        else:
            self._hear(now_s, chunk)

    def _obey(self, request: Request, came_s: float) -> None:
        self._came_s, stood = came_s, not self.charger.running
        super()._obey(request, came_s)
        if self._strange and stood is self.charger.running:
            self.on_stranger(stood)
        elif stood and self.charger.running:
            self.on_started(self._time.now_s)

    def hears_stranger(self, frames: bytes) -> None:
        """Another program writes valid frames to this port. Its stop does not count as ours."""
        if self.mute_rx or not (self._tty.clear and self._tty.present):
            return
        first_stop_s, self._strange = self.counters.first_stop_s, True
        try:
            self._hear(self._time.now_s, frames)
        finally:
            self.counters.first_stop_s, self._strange = first_stop_s, False

    def _say(self, answer: bytes) -> None:
        if self.late_s is None or self.mute_tx:
            super()._say(answer)
            return
        size = -(-len(answer) // self.pieces)
        pieces = [answer[at : at + size] for at in range(0, len(answer), size)]
        due_s = self._came_s + self._dice.uniform(*self.late_s)
        for left, piece in enumerate(reversed(pieces)):
            at_s = max(due_s - left * 0.5 * (due_s - self._came_s) / self.pieces, self._time.now_s)
            self._time.call_at(at_s, self._write, piece)

    def _write(self, data: bytes) -> None:
        if self._plugged:
            self._tty.deliver(data)


class VirtualRig(Rig):
    """The object `sim.faults` acts on."""

    wire: MemoryWire
    frozen = False  #: all values of its BMU are frozen
    apart_v = 0.0  #: most of the time it reports this much more than the truth
    steady = False  #: its BMU tells the same lie in every answer

    def __init__(self, time: Time, bus: BusWire, tty: Tty, node_id: int, nature: Nature) -> None:
        charger = SimulatedCharger(nature.control)
        if nature.running:
            charger.run, charger.mode, charger.current_step = True, ChargeMode.CHARGE, len(charger.steps_a) - 1
        self.bay = CutBay(charger, nature.pack)
        self.breaker = self.bay.breaker = Breaker(time) if nature.contactor else None
        if self.breaker is not None:
            self.breaker.on_moved = lambda _closed: self.catch_up(force=True)
        self.as_built = AsBuilt(charger.control_mode, nature.pack.ambient_c, nature.pack.cells)
        self.injected_s: float | None = None
        self.tty = tty
        self._loop = cast("Any", time)
        self._speed = nature.speed
        self._advanced_s = time.now_s
        line = LINES[nature.line]
        line = type(line)(**{name: getattr(line, name) for name in line.__slots__} | {"seed": nature.seed})
        self.wire = MemoryWire(time, charger, tty, line, self.catch_up)
        set_scheduler(AsyncScheduler(time))
        self.bmu = Bmu(cast("Any", time), cast("Any", bus), node_id, self._readout, main_loop=nature.main_loop)
        self.bmu.port.faults.delay_s = ANSWER_S
        self.wire.open()
        self.catch_up(force=True)

    def catch_up(self, *, force: bool = False) -> None:
        now_s = self._loop.time()
        if force or now_s - self._advanced_s >= FRESH_S:
            self.bay.advance(max(now_s - self._advanced_s, 0.001) * self._speed)
            self._advanced_s = now_s

    def _readout(self) -> Readout:
        self.catch_up()
        return self.bay.readout()
