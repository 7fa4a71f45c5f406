"""The classes of inputs: everything that a charger and a battery can show at the moment of a decision, as tables.

A battery's classes are cut at the policy's own thresholds: just below, at, and just above each bound. A charger's
classes are its possible reactions to a command, and its possible reports. Both are made fresh for each decision, so
a story can leave any of them at any time.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from orchestrator.core.memory import Memory
from orchestrator.core.parts import changed, made
from orchestrator.core.rules import Rules
from orchestrator.core.states import AT_WORK, ENERGISED
from orchestrator.model import (
    Action,
    Cause,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    Operation,
    Precharge,
    Request,
    Sent,
    Snapshot,
    State,
)
from orchestrator.model.cause import said
from orchestrator.workbench.prove.batteries import Shown, batteries
from orchestrator.workbench.prove.story import TICK_S, Move

#: Ages at the moment of the decision: of the last command and stop, of readings requested after them, of old values.
SENT_AGE_S, READ_AGE_S, OLD_S = 0.1, 0.05, 30.0
#: If two timers differ by no more than this factor, one jump past the longer covers both.
ALIKE = 1.1
#: The states in which the policy's tables are used, or may be by the end of the decision.
#: The current in precharge.
PRECHARGE_A = 1.0
#: What a charger reports in each stage.
STAGES = {
    State.PRECHARGE_PULSE: (ChargeMode.PRECHARGE, Precharge.PULSE),
    State.PRECHARGE_CONTINUOUS: (ChargeMode.PRECHARGE, Precharge.CONTINUOUS),
    State.CHARGING: (ChargeMode.CHARGE, Precharge.OFF),
}


@dataclass(slots=True)
class Said:
    """A charger's reading and link, from which a snapshot is made."""

    reading: dict[str, Any]
    link: dict[str, Any]
    silent: bool = False  #: there is no reading at all


Charger = Callable[[Said, float], None]


def _link(**changes: Any) -> Charger:  # noqa: ANN401 - fields of ChargerLink
    return lambda said, now_s: said.link.update(
        {name: value(now_s) if callable(value) else value for name, value in changes.items()}
    )


def _reading(**changes: Any) -> Charger:  # noqa: ANN401 - fields of ChargerReading
    return lambda said, _: said.reading.update(changes)


def _both(*parts: Charger) -> Charger:
    def change(said: Said, now_s: float) -> None:
        for part in parts:
            part(said, now_s)

    return change


NOT_OPENED = said("not opened yet")


def _never(said: Said, _: float) -> None:
    said.silent = True
    said.link.update(online=False, misses=0, stop_sent_s=None, sent=None, problem=NOT_OPENED)


def _ran_by_itself(said: Said, _: float) -> None:
    said.reading.update(operation=Operation.RUNNING, charge_mode=ChargeMode.CHARGE, current_a=said.reading["full_a"])


def _switched(said: Said, _: float) -> None:
    said.reading["control_mode"] = ControlMode(1 - said.reading["control_mode"])


_STANDBY = _reading(operation=Operation.STOPPED, charge_mode=ChargeMode.FULL, current_a=0.0)

#: As in `batteries.py`.
READING = ChargerReading(0.0, 0.0, 0.0, None, None, None, None, None, None)
LINK, SNAPSHOT, RESUME = ChargerLink(), Snapshot(), Command(Action.RESUME)

#: How each class of charger differs from one that has just obeyed.
CHARGERS: Mapping[str, Charger] = {
    "obeys": _reading(),
    "stands by, whatever it is told": _STANDBY,
    "stands by, no stop written yet": _both(_STANDBY, _link(stop_sent_s=None, sent=None)),
    "runs, whatever it is told": _ran_by_itself,
    "delivers, though it says stopped": _reading(operation=Operation.STOPPED, current_a=2.0),
    "stands by and was set up anew": _both(
        _STANDBY, _link(taken_over=said("9600 baud"), taken_over_t_s=lambda now_s: now_s)
    ),
    "shares its port": _link(locked_by=said("gpsd (pid 812)")),
    "runs without current": _both(_ran_by_itself, _reading(current_a=0.0)),
    "searches": _reading(charge_mode=ChargeMode.BATTERY_SEARCH, current_a=0.0),
    "recovers": _reading(charge_mode=ChargeMode.BATTERY_RECOVERY, current_a=0.0),
    "full by itself": _reading(charge_mode=ChargeMode.FULL, operation=Operation.STOPPED, current_a=0.0),
    "stopped by an error": _both(_STANDBY, _reading(charge_mode=ChargeMode.ERROR_STOP)),
    "stopped by its system": _both(_STANDBY, _reading(charge_mode=ChargeMode.SYSTEM_STOP)),
    "reversed": _both(_STANDBY, _reading(charge_mode=ChargeMode.REVERSED, connection=Connection.REVERSED)),
    "undocumented mode": _reading(charge_mode=None, illegal=(said("charge mode 9"),)),
    "undocumented operation": _reading(operation=None, illegal=(said("operation 2"),)),
    "in the other control mode": _switched,
    "too much current": _both(_ran_by_itself, _reading(current_a=40.0)),
    "complains of commands": _link(error_bits=2, error_t_s=lambda now_s: now_s - READ_AGE_S),
    "complains of checksums": _link(error_bits=8, error_t_s=lambda now_s: now_s - READ_AGE_S),
    "silent": _both(_reading(age_s=OLD_S), _link(online=False, misses=9, problem=said("no answer"))),
    "just fell silent": _both(_reading(age_s=0.9), _link(online=False, misses=3, problem=said("no answer"))),
    "port gone": _both(_reading(age_s=OLD_S), _link(online=False, misses=9, problem=said("gone"), stop_sent_s=None)),
    "never heard": _never,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class StationInputs:
    """The inputs of one bay: its charger's classes, its policy's battery classes, the jumps over timers."""

    rules: Rules
    jumps_s: tuple[float, ...] = ()
    chargers: Mapping[str, Charger] = field(default_factory=lambda: CHARGERS)
    batteries: Mapping[str, Shown] = field(default_factory=dict)

    @classmethod
    def of(cls, rules: Rules) -> "StationInputs":
        """All classes cut by the bay's policy and station file."""
        return cls(rules, jumps(rules), CHARGERS, batteries(rules))

    def moves(self, state: State) -> Iterator[Move]:
        """Each class in the next moment and after each jump, and every request in simple surroundings."""
        constants = [(charger, battery) for charger, battery in self.constants() if self.tells(battery, state)]
        for dt_s in (TICK_S, *self.jumps_s):
            for charger, battery in constants:
                yield Move(dt_s, charger, battery)
        for request in Request:
            for charger in ("obeys", "runs, whatever it is told", "silent", "stands by, whatever it is told"):
                for battery in ("healthy", "absent", "full"):
                    if charger in self.chargers and battery in self.batteries:
                        yield Move(TICK_S, charger, battery, request)
        yield Move(TICK_S, "obeys", "healthy", internal="seen by the checker")
        yield Move(TICK_S, "obeys", "healthy", ending=Cause.of("signal", name="SIGTERM"))
        for charger in ("obeys", "runs, whatever it is told", "silent"):
            if charger in self.chargers:
                yield Move(TICK_S, charger, "healthy", restart=True)

    def pairs(self, state: State) -> Iterator[Move]:
        """Every charger with every battery in the next moment."""
        batteries = [battery for battery in self.batteries if self.tells(battery, state)]
        return (Move(TICK_S, charger, battery) for charger in self.chargers for battery in batteries)

    def constants(self) -> Iterator[tuple[str, str]]:
        """Each charger with a healthy battery, each battery with an obedient charger."""
        yield from ((charger, "healthy") for charger in self.chargers)
        yield from (("obeys", battery) for battery in self.batteries if battery != "healthy")

    def tells(self, battery: str, state: State) -> bool:
        """Whether it is a separate class in this state: at rest, the policy's tables are not used."""
        return state in AT_WORK or not self.batteries[battery].at_work

    def snapshot(self, move: Move, now_s: float, memory: Memory) -> Snapshot:
        """The input of the decision."""
        shown = self.batteries[move.battery]
        said = self._obedient(shown, now_s, memory)
        self.chargers[move.charger](said, now_s)
        amps = said.reading.pop("current_a")
        said.reading.pop("full_a")
        age_s = said.reading.pop("age_s")
        reading = None if said.silent else changed(READING, t_s=now_s - age_s, current_a=amps, **said.reading)
        values, link = shown.at(now_s, memory, 0.0 if reading is None else amps)
        link_of_charger = changed(LINK, **said.link)
        return changed(
            SNAPSHOT, charger=reading, charger_link=link_of_charger, battery=values, battery_link=link,
            request=move.request, internal=move.internal, ending=move.ending,
        )  # fmt: skip

    def _obedient(self, shown: Shown, now_s: float, memory: Memory) -> Said:
        """A charger that has just carried out the last decision's command."""
        command = memory.sequence.command
        values = {
            "voltage_v": shown.volts + shown.differs_v if shown.connected else 0.0,
            "control_mode": self.rules.bay.charger.control, "operation": Operation.STOPPED, "current_step": 0,
            "charge_mode": ChargeMode.FULL, "precharge": Precharge.OFF, "connection": Connection.NORMAL,
        }  # fmt: skip
        if memory.state in ENERGISED:
            values |= _setpoint(memory, manual=self.rules.manual)
        limit_a = self.rules.steps_a[int(values["current_step"])] * shown.takes
        charging = values["charge_mode"] is ChargeMode.CHARGE
        flows_a = 0.0 if not values["operation"] else limit_a if charging else min(PRECHARGE_A, limit_a)
        sent = command if memory.sequence.resumed and command is not None else RESUME
        return Said(
            {**values, "current_a": flows_a, "full_a": limit_a, "age_s": READ_AGE_S},
            {"online": True, "sent": made(Sent, sent, now_s - SENT_AGE_S), "stop_sent_s": now_s - SENT_AGE_S},
        )


#: The commands of a sequence, in order; those before the present one have been obeyed.
SEQUENCE = (Action.SET_LIMIT, Action.SET_MODE, Action.SET_PRECHARGE, Action.RUN)


def _setpoint(memory: Memory, *, manual: bool) -> dict[str, Any]:
    """The setpoint as reported by an obedient charger: everything up to the present command."""
    action = memory.sequence.command.action if memory.sequence.command is not None else Action.RUN
    running = memory.stage.ran or action is Action.RUN or (action is Action.RESUME and not manual)
    done = len(SEQUENCE) if running or not manual else SEQUENCE.index(action)
    shows: dict[str, Any] = {"operation": Operation(int(running)), "charge_mode": ChargeMode.CHARGE}
    if manual:
        shows["current_step"] = memory.stage.step.index if memory.stage.step is not None else 0
        shows["charge_mode"] = STAGES[memory.state][0] if done >= 1 else ChargeMode.FULL
        shows["precharge"] = STAGES[memory.state][1] if done >= SEQUENCE.index(Action.SET_PRECHARGE) else Precharge.OFF
    return shows


def jumps(rules: Rules) -> tuple[float, ...]:
    """Jumps just beyond every timer of core and policy, so that no timer is waited out tick by tick."""
    policy = rules.policy
    timers = [2.0, 3.0, 5.0, 10.0, 70.0, 310.0, 3600.0]
    timers.append(rules.max_hours * 3600)
    if rules.taper is not None:
        timers.append(rules.taper.for_s)
    if policy.finish.hold_min:
        timers.append(policy.finish.hold_min * 60)
    if policy.finish.full_every_days is not None:
        timers.append(policy.finish.full_every_days * 86400)
    if policy.precharge is not None:
        rule = policy.precharge
        timers += [m * 60 for m in (rule.pulse.max_min, rule.continuous.max_min, rule.rise.within_min)]
    apart = [timer for timer in timers if not any(timer < other < timer * ALIKE for other in timers)]
    return tuple(sorted({timer + 0.1 for timer in apart}))
