"""A whole bay whose time jumps: the product's core, interlock and port schedule on an emulated charger and pack.

Nothing here answers to suit the core: commands take slots, frames get lost, and values have their real age.
"""

from dataclasses import replace
from random import Random

from orchestrator.config.station import BayConfig
from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.devices.schedule import Schedule, Turn
from orchestrator.interlock import Grant, grant, permit
from orchestrator.model import (
    STOP,
    Action,
    BatteryLink,
    BatteryReading,
    Cause,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Command,
    ControlMode,
    Decision,
    Measurement,
    Precharge,
    Request,
    Sent,
    Snapshot,
    State,
)
from orchestrator.sim.bay import SimulatedBay as Plant
from orchestrator.sim.charger import Push, SimulatedCharger
from orchestrator.sim.pack import Pack
from tests.core.said import cause, fits, reason_of
from tests.core.world import bay

TICK_S = 0.1
#: An exchange with the charger, from the request's first byte to the answer.
EXCHANGE_S = 0.03
MISSES_UNTIL_SILENT = 5
BMU_SILENT_S = 1.5
PUSHES = {
    Action.SET_LIMIT: Push.CURRENT_LIMIT,
    Action.SET_MODE: Push.CHARGE_MODE,
    Action.SET_PRECHARGE: Push.PRECHARGE,
}
FAST = ("voltage_v", "current_a", "status", "temperature_c")
SLOW = ("soc_pct", "soh_pct")


class Site:
    """`run` lets time pass; `moves` holds every change of state with its time and reason."""

    def __init__(
        self,
        pack: Pack,
        the_bay: BayConfig | None = None,
        *,
        loss: float = 0.0,
        can_loss: float = 0.0,
        seed: int = 1,
        start_s: float = 1000.0,
    ) -> None:
        self.rules = Rules.of(the_bay or bay())
        self.memory = Memory()
        self.now_s = start_s
        self.loss, self.can_loss = loss, can_loss
        self.chance = Random(seed)
        self.plant = Plant(SimulatedCharger(self.rules.bay.charger.control, self.rules.steps_a), pack)
        self.schedule = Schedule(self.rules.bay.charger.control)
        self.schedule.restart(start_s)
        self.grant: Grant | None = None
        self.reading: ChargerReading | None = None
        self.link = ChargerLink()
        self.values = BatteryReading()
        self.battery_link = BatteryLink()
        self.decision = Decision(State.STARTING, Memory().cause)
        self.moves: list[tuple[float, State, str]] = []
        self.raised: dict[str, int] = {}  #: how often each fault was raised

    @property
    def charger(self) -> SimulatedCharger:
        return self.plant.charger

    @property
    def pack(self) -> Pack:
        return self.plant.pack

    def run(self, seconds: float, request: Request | None = None) -> Decision:
        end_s = self.now_s + seconds - TICK_S / 2
        while self.now_s < end_s:
            self.tick(request)
            request = None
        return self.decision

    def until(self, state: State, at_most_s: float) -> Decision:
        end_s = self.now_s + at_most_s
        while self.now_s < end_s:
            self.tick()
            if self.decision.state is state:
                return self.decision
        raise AssertionError(f"{state} not reached in {at_most_s} s, but {self.decision}, after {self.moves[-8:]}")

    def tick(self, request: Request | None = None) -> None:
        self.now_s += TICK_S
        self.plant.advance(TICK_S)
        self._line()
        self._bus()
        snapshot = Snapshot(self.reading, self.link, self.values, self.battery_link, request)
        before = self.decision
        self.decision, self.memory = decide(self.now_s, snapshot, self.memory, self.rules)
        fits(self.decision)
        command = self.decision.command
        self.schedule.give(command)
        self.grant = grant(snapshot, self.now_s) if command else None
        if before.state is not self.decision.state:
            self.moves.append((round(self.now_s, 1), self.decision.state, reason_of(self.decision)))
        known = {fault.id for fault in before.faults}
        for fault in self.decision.faults:
            if fault.id not in known:
                self.raised[fault.id] = self.raised.get(fault.id, 0) + 1

    # --- the serial line ---

    def _line(self) -> None:
        while (due := self.schedule.next()).at_s <= self.now_s:
            command = self.schedule.command
            if due.turn is Turn.STOP:
                self._write(due.turn, STOP, whole=self.rules.bay.charger.control is ControlMode.AUTOMATIC)
            elif due.turn is Turn.OPERATION_STOP:
                self._write(due.turn, STOP, whole=True)
            elif due.turn is Turn.ORDER and command is not None:
                refused = permit(command, self.grant, self.now_s, self.rules.bay.charger, self.rules.bay.limits)
                if refused:
                    self._poll(refused)
                else:
                    self._write(due.turn, command)
            else:
                self._poll()

    def _lost(self) -> bool:
        return self.chance.random() < self.loss

    def _write(self, turn: Turn, command: Command, *, whole: bool = False) -> None:
        if not self._lost():
            self._hear(turn, command)
        self.schedule.took(turn, self.now_s, self.now_s)
        stop_sent_s = self.now_s if whole else self.link.stop_sent_s
        self.link = replace(self.link, sent=Sent(command, self.now_s), stop_sent_s=stop_sent_s, refused=None)

    def _hear(self, turn: Turn, command: Command) -> None:
        if turn is Turn.STOP:
            self.charger.rest(0)
        elif turn is Turn.OPERATION_STOP:
            self.charger.push(Push.OPERATION, 0)
        elif command.action is Action.RESUME:
            self.charger.rest(1)
        elif command.action is Action.RUN:
            self.charger.push(Push.OPERATION, 1)
        else:
            self.charger.push(PUSHES[command.action], command.value)

    def _poll(self, refused: Cause | None = None) -> None:
        self.schedule.took(Turn.POLL, self.now_s, self.now_s)
        if self._lost() or self._lost():
            misses = self.link.misses + 1
            online = self.link.online and misses < MISSES_UNTIL_SILENT
            problem = None if misses < MISSES_UNTIL_SILENT else cause("no answer")
            self.link = replace(self.link, misses=misses, online=online, problem=problem, refused=refused)
            return
        charger = self.charger
        self.link = replace(self.link, misses=0, online=True, problem=None, refused=refused)
        self.reading = ChargerReading(
            t_s=self.now_s,
            voltage_v=round(charger.voltage_v, 2),
            current_a=round(charger.current_a, 2),
            control_mode=charger.control_mode,
            operation=charger.operation,
            current_step=charger.current_step,
            charge_mode=ChargeMode(charger.charge_mode),
            precharge=Precharge(charger.precharge),
            connection=charger.connection,
        )

    # --- the bus ---

    def _bus(self) -> None:
        if self.plant.connected:
            readout = self.plant.readout()
            slow = round(self.now_s / TICK_S) % 10 == 0
            heard = {
                name: Measurement(float(getattr(readout, name)), self.now_s)
                for name in (FAST + SLOW if slow else FAST)
                if self.chance.random() >= self.can_loss
            }
            self.values = replace(self.values, **heard)
        newest_s = max((m.t_s for m in (self.values.voltage_v, self.values.status) if m), default=-1e9)
        self.battery_link = replace(self.battery_link, online=self.now_s - newest_s < BMU_SILENT_S)
