"""A bay whose time jumps: an obedient charger and a healthy battery, which a test then spoils.

Each tick the charger receives the last standing command, both devices are read, and one decision is made. Nothing is
late or lost unless a test says so; for that there is `site.py`.
"""

from dataclasses import dataclass, replace
from typing import Any

from orchestrator.config.load import load_policy
from orchestrator.config.policy import Pack, Policy
from orchestrator.config.station import BatteryConfig, BayConfig, ChargerConfig, Limits
from orchestrator.core.cells import chemistry
from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory, with_values
from orchestrator.core.rules import Rules
from orchestrator.keys import Range
from orchestrator.model import (
    Action,
    BatteryLink,
    BatteryReading,
    Cause,
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
from tests.core.said import cause, fits, say

STEPS_A = (2.0, 5.0, 8.0, 11.0, 14.0)
#: A binary fraction, so that a limit can be hit exactly.
TICK_S = 0.25
#: What the device layer calls silence.
MISSES_UNTIL_SILENT = 5
BMU_SILENT_S = 1.5


#: li-ion-48v in amperes alone; its charge also ends by SOC, so that a test can end one by setting a value.
TABLE = "current.temperature_c.rows"
POLICY = load_policy("li-ion-48v", changes={
    f"{TABLE}[0].max_c": "null", f"{TABLE}[0].max_a": "2.0", f"{TABLE}[1].max_c": "null", f"{TABLE}[1].max_a": "6.0",
    "current.where[0].max_c": "null", "current.where[0].max_a": "2.0",
    "pack.capacity_ah": "null", "finish.full.soc_pct": "100", "finish.max_hours": "12",
})  # fmt: skip


def with_full(**changes: Any) -> Policy:
    """The same with another way to know that a pack is full."""
    finish = POLICY.finish
    return replace(POLICY, finish=replace(finish, full=replace(finish.full, **changes)))


def bay(policy: Policy | None = None, control: ControlMode = ControlMode.MANUAL, current_a: float = 15.0) -> BayConfig:
    """A bay on li-ion-48v with the design's example limits."""
    return BayConfig(
        name="bay-1",
        charger=ChargerConfig(port="/dev/ttyX", control=control, steps_a=STEPS_A),
        battery=BatteryConfig(can="can0", node_id=0x10, map=ObjectMap(map="none", objects=())),
        limits=Limits(voltage_v=58.4, current_a=current_a, temperature_c=Range(0, 45)),
        policy=policy or POLICY,
    )


@dataclass
class Charger:
    """As documented; like the one in `sim` it remembers its run command over a standby."""

    manual: bool
    resting: bool = True
    run: bool = False
    limit: int = 0
    mode: ChargeMode = ChargeMode.FULL
    precharge: Precharge = Precharge.OFF

    @property
    def running(self) -> bool:
        return not self.resting and (self.run or not self.manual)

    @property
    def shown_mode(self) -> ChargeMode:
        return ChargeMode.FULL if self.resting else self.mode

    def obey(self, command: Command) -> None:
        match command.action:
            case Action.STOP:
                self.resting, self.run = True, False
            case Action.RESUME:
                self.resting = False
                self.mode = self.mode if self.manual else ChargeMode.CHARGE
            case Action.SET_LIMIT:
                self.limit = command.value
            case Action.SET_MODE:
                self.mode = ChargeMode(command.value)
            case Action.SET_PRECHARGE:
                self.precharge = Precharge(command.value)
            case Action.RUN:
                self.run = self.run or not self.resting


#: A pack that fits its SOC is this far inside the bounds for it.
WELL_INSIDE_V = 0.005


def fitting_soc_pct(pack_v: float, cells: int = 13) -> float:
    """The SOC of a healthy pack at this voltage: almost empty if it is deeply discharged, else half full."""
    return 2.0 if pack_v < 3.23 * cells else 50.0


def fitting_v(pack: Pack, soc_pct: float, pack_v: float) -> float:
    """The voltage next to `pack_v` that a pack can have at this state of charge."""
    low_v, high_v = chemistry(pack).bounds_v(soc_pct)
    cell_v = min(max(pack_v / pack.cells_in_series, low_v + WELL_INSIDE_V), high_v - WELL_INSIDE_V)
    return cell_v * pack.cells_in_series if cell_v != pack_v / pack.cells_in_series else pack_v


def remembering(memory: Memory | None = None, **values: Any) -> Memory:
    """A memory, or this one, with some values set by name, in whichever part they are."""
    return with_values(memory or Memory(), **values)


class World:
    """Everything true of one bay; `run` lets time pass in ticks, `decision` is the newest."""

    def __init__(self, the_bay: BayConfig | None = None, **battery: float) -> None:
        self.rules = Rules.of(the_bay or bay())
        self.memory = Memory()
        self.now_s = 1000.0
        self.charger = Charger(self.rules.manual)
        self.deaf: set[Action] = set()  #: commands that the charger does not receive
        self.writes = True  #: the port hands commands over
        self.charger_answers = True
        self.battery_answers = True
        self.port_hangs = False  #: nobody polls the charger any more, so nobody counts misses
        self.shows: dict[str, Any] = {}  #: what the charger's status reports instead of the truth
        self.amps: float | None = None  #: the current while it runs, whatever was set
        self.leak_a = 0.0  #: the current while it does not
        self.volts: float | None = None  #: at the charger, if different from the pack's
        self.charger_link = ChargerLink(online=True)
        self.battery_link = BatteryLink(online=True)
        self.values: dict[str, float | None] = {
            "voltage_v": 48.0,
            "current_a": 0.0,
            "status": 0.0,
            "temperature_c": 20.0,
            "soc_pct": fitting_soc_pct(battery.get("voltage_v", 48.0)),
            "soh_pct": 100.0,
            **battery,
        }
        self._fitted_pct = self.values["soc_pct"] if "voltage_v" in battery else None
        self._fitted_v = self.values["voltage_v"]
        self.counted_min = 60.0  #: what a BMU counts keeps moving, whatever stands still
        self.counts = True
        self.frozen: set[str] = set()  #: values that are no longer read
        self.pack_amps: float | None = None  #: what the BMU measures, if different from what flows
        self.shunt = 1.0  #: the share of it that the BMU measures
        self.reading: ChargerReading | None = None
        self.measured: dict[str, Measurement] = {}
        self.heard_s = self.now_s  #: when the BMU last answered
        self.connected = True  #: the contactor, if there is one, is closed
        self.contactor_problem: Cause | None = None
        self.internal = ""  #: an exception of our own, for one tick
        self.ours: dict[str, Any] = {}  #: what else the service reports of itself
        self.decisions: list[Decision] = []

    @property
    def decision(self) -> Decision:
        return self.decisions[-1]

    @property
    def state(self) -> State:
        return self.decision.state

    def is_in(self, *states: State) -> bool:
        return self.state in states

    @property
    def raised(self) -> dict[str, str]:
        """The active faults: id and text."""
        return {fault.id: say(fault.cause) for fault in self.decision.faults}

    @property
    def told(self) -> dict[str, str]:
        """The same with their times, their figures, and what ends them."""
        return {fault.id: say(fault.told) for fault in self.decision.faults}

    @property
    def commands(self) -> list[Command | None]:
        """The standing commands so far, each once."""
        commands = [decision.command for decision in self.decisions]
        return [now for before, now in zip([None, *commands], commands, strict=False) if now != before]

    def states(self, since_s: float = 0.0) -> list[State]:
        """The states passed through in the last `since_s` seconds (0: ever), each once."""
        ticks = round(since_s / TICK_S)
        states = [decision.state for decision in self.decisions[-ticks:]]
        return [now for before, now in zip([None, *states], states, strict=False) if now is not before]

    def tick(self, dt_s: float = TICK_S, request: Request | None = None, asked_by: Cause | None = None) -> Decision:
        self.now_s += dt_s
        self._fit()
        self._obey(dt_s)
        internal, self.internal = self.internal, ""
        snapshot = replace(self.snapshot(request, internal), asked_by=asked_by)
        decision, self.memory = decide(self.now_s, snapshot, self.memory, self.rules)
        self.decisions.append(decision)
        fits(decision)
        return decision

    def forget(self, fault: str) -> None:
        """Forget a fault that the test is not about."""
        faults = {name: kept for name, kept in self.memory.faults.items() if name != fault}
        self.memory = remembering(self.memory, faults=faults)

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

    def ask(self, request: Request) -> str:
        """The answer to the request; "" is yes."""
        return say(self.tick(request=request).answer)

    def charging(self, state: State = State.CHARGING) -> "World":
        """Run until the charger does everything commanded in `state`."""
        self.until(state, 4000.0)
        while self.decision.command is not None:
            self.tick()
        return self

    def boot(self) -> None:
        """The BMU boots: none of its earlier values hold any more."""
        link = self.battery_link
        self.battery_link = replace(link, boots=link.boots + 1, boot_t_s=self.now_s, heartbeat_s=None)
        self.measured = {}

    def leave(self) -> None:
        """Somebody takes the battery out."""
        self.battery_answers, self.volts, self.amps = False, 0.0, 0.0

    def arrive(self, **battery: float) -> None:
        """Somebody puts a battery in."""
        self.battery_answers, self.volts, self.amps = True, None, None
        self.values.update(battery)

    # --- what is read ---

    def snapshot(self, request: Request | None, internal: str) -> Snapshot:
        if self.charger_answers and not self.port_hangs:
            self.reading = self._reading()
        if self.battery_answers:
            self.heard_s = self.now_s
            for name, value in ({"time_to_empty_min": self.counted_min} | self.values).items():
                if value is None:
                    self.measured.pop(name, None)
                elif name not in self.frozen:
                    self.measured[name] = Measurement(value, self.now_s)
        silent = self.now_s - self.heard_s >= BMU_SILENT_S
        return Snapshot(
            charger=self.reading,
            charger_link=self._line(),
            battery=BatteryReading(**self.measured),
            battery_link=replace(self.battery_link, online=self.battery_link.online and not silent),
            request=request,
            internal=internal,
            connected=self.connected,
            contactor_problem=self.contactor_problem,
            **self.ours,
        )

    def _line(self) -> ChargerLink:
        link = self.charger_link
        misses = 0 if self.charger_answers else link.misses + 1
        self.charger_link = replace(link, misses=misses)
        if misses < MISSES_UNTIL_SILENT:
            return self.charger_link
        return replace(
            self.charger_link, online=False, problem=self.charger_link.problem or cause("/dev/ttyX: no answer")
        )

    def _reading(self) -> ChargerReading:
        charger = self.charger
        truth: dict[str, Any] = {
            "t_s": self.now_s,
            "voltage_v": self.volts if self.volts is not None else self.values["voltage_v"] or 0.0,
            "current_a": self._amps(),
            "control_mode": self.rules.bay.charger.control,
            "operation": Operation.RUNNING if charger.running else Operation.STOPPED,
            "current_step": charger.limit,
            "charge_mode": charger.shown_mode,
            "precharge": charger.precharge,
            "connection": Connection.NORMAL,
        }
        return ChargerReading(**{**truth, **self.shows})

    def _amps(self) -> float:
        if not self.charger.running:
            return self.leak_a
        return STEPS_A[self.charger.limit] if self.amps is None else self.amps

    def _obey(self, dt_s: float) -> None:
        """What a port and a charger do with the last decision within one tick."""
        command = self.decisions[-1].command if self.decisions else None
        if command is not None and self.writes:
            sent_s = self.now_s - dt_s / 2
            stop_s = sent_s if command.action is Action.STOP else self.charger_link.stop_sent_s
            self.charger_link = replace(self.charger_link, sent=Sent(command, sent_s), stop_sent_s=stop_s)
            if command.action not in self.deaf:
                self.charger.obey(command)
        if self.values["current_a"] is not None:
            self.values["current_a"] = self._amps() * self.shunt if self.pack_amps is None else self.pack_amps
        self.counted_min += self._amps() * dt_s / 60 if self.counts else 0.0

    def _fit(self) -> None:
        """If a test has set only the SOC, the voltage follows it."""
        soc_pct, pack_v = self.values["soc_pct"], self.values["voltage_v"]
        if soc_pct != self._fitted_pct and soc_pct is not None and pack_v is not None and pack_v == self._fitted_v:
            self.values["voltage_v"] = fitting_v(self.rules.policy.pack, soc_pct, pack_v)
        self._fitted_pct, self._fitted_v = soc_pct, self.values["voltage_v"]
