"""A bay whose time jumps: an obedient charger and a healthy battery, which a test then spoils."""

from dataclasses import replace
from typing import Any

from orchestrator.config.load import load_policy
from orchestrator.config.policy import Policy
from orchestrator.config.station import BatteryConfig, Bay, ChargerConfig, Limits
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.core.step import step
from orchestrator.keys import Range
from orchestrator.model import (
    Action,
    BatteryLink,
    BatteryReading,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    Decision,
    Measurement,
    Operation,
    Precharge,
    Request,
    Sent,
    Snapshot,
    State,
)
from orchestrator.protocol.objects import ObjectMap

STEPS_A = (2.0, 5.0, 8.0, 11.0, 14.0)
TICK_S = 0.2


def bay(policy: Policy | None = None, control: ControlMode = ControlMode.MANUAL, current_a: float = 15.0) -> Bay:
    """A bay on li-ion-48v with the design's example limits."""
    return Bay(
        name="bay-1",
        charger=ChargerConfig(port="/dev/ttyX", control=control, steps_a=STEPS_A),
        battery=BatteryConfig(can="can0", node_id=0x10, map=ObjectMap(map="none", objects=())),
        limits=Limits(voltage_v=58.4, current_a=current_a, temperature_c=Range(0, 45)),
        policy=policy or load_policy("li-ion-48v"),
    )


class World:
    """Everything true of one bay; `run` lets time pass in ticks, `decision` is the newest."""

    def __init__(self, the_bay: Bay | None = None, **battery: float) -> None:
        self.rules = Rules.of(the_bay or bay())
        self.memory = Memory()
        self.now_s = 1000.0
        self.obeys = True
        self.charger_answers = True
        self.battery_answers = True
        self.resumed = False
        self.charger = ChargerReading(
            self.now_s,
            48.0,
            0.0,
            self.rules.bay.charger.control,
            Operation.STOPPED,
            0,
            ChargeMode.FULL,
            Precharge.OFF,
            Connection.NORMAL,
        )
        self.charger_link = ChargerLink(online=True)
        self.battery_link = BatteryLink(online=True)
        self.values: dict[str, float | None] = {
            "voltage_v": 48.0,
            "current_a": 0.0,
            "status": 0.0,
            "temperature_c": 20.0,
            "soc_pct": 50.0,
            "soh_pct": 100.0,
            **battery,
        }
        self.charger_overrides: dict[str, Any] = {}
        self.amps: float | None = None  #: overrides what flows
        self.decisions: list[Decision] = []

    @property
    def decision(self) -> Decision:
        return self.decisions[-1]

    @property
    def state(self) -> State:
        return self.decision.state

    def tick(self, dt_s: float = TICK_S, request: Request | None = None, internal: str = "") -> Decision:
        self.now_s += dt_s
        self._obey()
        decision, self.memory = step(self.now_s, self.snapshot(request, internal), self.memory, self.rules)
        self.decisions.append(decision)
        return decision

    def run(self, seconds: float, dt_s: float = TICK_S) -> Decision:
        for _ in range(max(1, round(seconds / dt_s))):
            self.tick(dt_s)
        return self.decision

    def until(self, state: State, at_most_s: float = 60.0) -> Decision:
        end_s = self.now_s + at_most_s
        while self.now_s < end_s:
            if self.tick().state is state:
                return self.decision
        raise AssertionError(f"{state} not reached in {at_most_s} s, but {self.decision}")

    def snapshot(self, request: Request | None, internal: str) -> Snapshot:
        t_s = self.now_s
        reading = replace(self.charger, **self.charger_overrides)
        battery = BatteryReading(**{k: Measurement(v, t_s) for k, v in self.values.items() if v is not None})
        if self.charger_answers:
            self.last_reading = replace(reading, t_s=t_s)
        if self.battery_answers:
            self.last_battery = battery
        return Snapshot(
            charger=getattr(self, "last_reading", None),
            charger_link=replace(self.charger_link, online=self.charger_answers and self.charger_link.online),
            battery=getattr(self, "last_battery", BatteryReading()),
            battery_link=replace(self.battery_link, online=self.battery_answers and self.battery_link.online),
            request=request,
            internal=internal,
        )

    def _obey(self) -> None:
        """What an ideal port and charger make of the last decision within one tick."""
        command = self.decisions[-1].command if self.decisions else None
        if command is not None:
            sent_s = self.now_s - TICK_S / 2
            stop_s = sent_s if command.action is Action.STOP else self.charger_link.stop_sent_s
            self.charger_link = replace(self.charger_link, sent=Sent(command, sent_s), stop_sent_s=stop_s)
            if self.obeys:
                self.charger = obeyed(self.charger, command)
        running = self.charger.operation is Operation.RUNNING
        amps = (STEPS_A[self.charger.current_limit or 0] if running else 0.0) if self.amps is None else self.amps
        self.charger = replace(self.charger, current_a=amps, voltage_v=self.values["voltage_v"] or 0.0)
        if self.amps is None and self.values["current_a"] is not None:
            self.values["current_a"] = amps


def obeyed(charger: ChargerReading, command: Command) -> ChargerReading:
    """What a charger shows after it has obeyed."""
    match command.action:
        case Action.STOP:
            return replace(charger, operation=Operation.STOPPED, charge_mode=ChargeMode.FULL)
        case Action.RESUME:
            running = Operation.STOPPED if charger.control_mode is ControlMode.MANUAL else Operation.RUNNING
            return replace(charger, charge_mode=ChargeMode.BATTERY_SEARCH, operation=running)
        case Action.SET_LIMIT:
            return replace(charger, current_limit=command.value)
        case Action.SET_MODE:
            return replace(charger, charge_mode=ChargeMode(command.value))
        case Action.SET_PRECHARGE:
            return replace(charger, precharge=Precharge(command.value))
        case Action.RUN:
            return replace(charger, operation=Operation.RUNNING)
