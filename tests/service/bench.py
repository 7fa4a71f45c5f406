"""A bay of the service without threads: the test is its control loop, devices obey at once, time is simulated."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from orchestrator.config.load import load_map, load_policy
from orchestrator.config.station import BatteryConfig, BayConfig, ChargerConfig, Limits
from orchestrator.core.persisted import Persisted
from orchestrator.interlock import Grant
from orchestrator.keys import Range
from orchestrator.model import (
    STOP,
    Action,
    BatteryLink,
    BatteryReading,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    Measurement,
    Operation,
    Precharge,
    Request,
    Sent,
    State,
)
from orchestrator.service.asked import Asked
from orchestrator.service.bay import BayRunner
from orchestrator.service.bayrecord import BayRecord
from orchestrator.service.contactor import Contactor
from orchestrator.service.journal import Journal
from orchestrator.service.past import Entry, Place
from orchestrator.service.recorder import Recorder
from orchestrator.service.records import Line
from orchestrator.service.store import Store
from orchestrator.text.catalogue import say
from tests.core.said import into

STEPS_A = (2.0, 5.0, 8.0, 11.0, 14.0)
STEP_S = 0.2
#: The voltage of 13 cells that are half full, or full without current: plausible for every SOC the tests set.
VOLTS = 50.4


def the_bay() -> BayConfig:
    return BayConfig(
        name="bay-1",
        charger=ChargerConfig(port="/dev/ttyX", control=ControlMode.MANUAL, steps_a=STEPS_A),
        battery=BatteryConfig(can="can0", node_id=0x10, map=load_map("tabos")),
        limits=Limits(voltage_v=58.4, current_a=15.0, temperature_c=Range(0, 45)),
        policy=load_policy("li-ion-48v", changes={"finish.full.soc_pct": "100"}),  # a test ends a charge by one value
    )


def fields_of(line: Line) -> Mapping[str, object]:
    """The fields of a line that the journal was given."""
    return line[1]() if callable(line[1]) else line[1]


class Charger:
    """Has obeyed by the next look. `orders` has every command it got."""

    def __init__(self) -> None:
        self.commands: list[tuple[Command | None, Grant | None]] = []
        self.reading = ChargerReading(
            0.0,
            VOLTS,
            0.0,
            ControlMode.MANUAL,
            Operation.STOPPED,
            0,
            ChargeMode.FULL,
            Precharge.OFF,
            Connection.NORMAL,
        )
        self.link = ChargerLink(online=True)
        self.deaf = False  #: disobeys from now on

    def command(self, command: Command | None, grant: Grant | None = None) -> None:
        self.commands.append((command, grant))

    @property
    def view(self) -> tuple[ChargerReading, ChargerLink]:
        return self.reading, self.link

    def pass_time(self, now_s: float) -> None:
        """Send the command given during the decision, then answer a poll."""
        command = self.commands[-1][0] if self.commands else None
        changes: dict[str, object] = {}
        if command is not None:
            sent_s = now_s - STEP_S / 2
            self.link = replace(self.link, sent=Sent(command, sent_s))
            if command == STOP:
                self.link = replace(self.link, stop_sent_s=sent_s)
            effects: dict[Action, dict[str, object]] = {
                Action.STOP: {"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL},
                Action.SET_LIMIT: {"current_step": command.value},
                Action.SET_MODE: {"charge_mode": ChargeMode(command.value) if command.value else None},
                Action.RUN: {"operation": Operation.RUNNING},
            }
            changes = {} if self.deaf else effects.get(command.action, {})
        reading = replace(self.reading, **changes)  # type: ignore[arg-type]  # the fields of a reading, by the order
        running = reading.operation is Operation.RUNNING
        self.reading = replace(reading, t_s=now_s, current_a=STEPS_A[reading.current_step or 0] if running else 0.0)


class Battery:
    """Reports `values`, fresh."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.link = BatteryLink(online=True)
        self.attended: list[bool] = []  #: whether it was to be watched closely, each time that this changed
        self.values = {
            "voltage_v": VOLTS,
            "current_a": 0.0,
            "status": 0.0,
            "temperature_c": 20.0,
            "soc_pct": 50.0,
            "soh_pct": 100.0,
        }

    @property
    def view(self) -> tuple[BatteryReading, BatteryLink]:
        fresh = {name: Measurement(value, self.now_s) for name, value in self.values.items()}
        return BatteryReading(**fresh), self.link

    def attend(self, *, closely: bool) -> None:
        self.attended.append(closely)


class Bench:
    """A bay, its devices, a journal whose lines stay in its queue, and a store on a real disk.

    `persisted` is the state left by the last run; the store writes after each decision while its `disk` works.
    """

    def __init__(
        self,
        directory: Path,
        persisted: Persisted | None = None,
        bay: BayConfig | None = None,
        *,
        max_mb: float = 1.0,
        now_s: float = 1000.0,
        wall: Callable[[], float] = time.time,
        contactor: Contactor | None = None,
        recorder: Recorder | None = None,
    ) -> None:
        self.charger, self.battery = Charger(), Battery()
        self.now_s = now_s
        self.asleep_s = 0.0
        self.journal = Journal(directory, max_mb, lambda: self.now_s, wall)
        self.said: list[str] = []
        chosen = bay or the_bay()
        place = Place.of(chosen)
        self.disk = True
        self.store = Store(directory, [place], lambda: self.now_s, time.time)
        self.store._begin([Entry(place, persisted or Persisted(), 1)])
        self.bay = BayRunner(
            chosen, self.charger, self.battery, self.journal, self.store, into(self.said), contactor=contactor,
            record=BayRecord(recorder, "a station", chosen) if recorder is not None else None,
        )  # fmt: skip

    def step(self, count: int = 1) -> State:
        for _ in range(count):
            self.now_s += STEP_S
            self.charger.pass_time(self.now_s)
            self.battery.now_s = self.now_s
            self.battery.values["current_a"] = self.charger.reading.current_a
            self.bay.run(self.now_s, self.asleep_s)
            if self.disk:
                self.store.turn()
                self.bay._answers.look(self.now_s)
        assert self.bay.decision is not None
        return self.bay.decision.state

    def until(self, state: State, at_most: int = 100) -> None:
        for _ in range(at_most):
            if self.step() is state:
                return
        raise AssertionError(f"{state} not reached, but {self.bay.decision}")

    def charging(self) -> None:
        """Run until it charges and the charger has every command."""
        self.until(State.CHARGING)
        self.step(10)
        assert self.charger.reading.current_a > 0

    def ask(self, request: Request) -> str:
        asked = Asked(request)
        self.bay.ask(asked)
        assert not asked.done.is_set()
        self.step()
        assert asked.done.is_set()
        return say(asked.answer)
