"""The classes of charger inputs: its possible reactions to a command, and its possible reports."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from orchestrator.core.memory import Memory
from orchestrator.core.parts import made
from orchestrator.core.rules import Rules
from orchestrator.core.states import ENERGISED
from orchestrator.model import (
    Action,
    ChargeMode,
    Command,
    Connection,
    ControlMode,
    Operation,
    Precharge,
    Sent,
    State,
)
from orchestrator.model.cause import said
from orchestrator.workbench.prove.batteries import OLD_S, Shown

#: Ages at the moment of the decision: of the last command and stop, and of readings requested after them.
SENT_AGE_S, READ_AGE_S = 0.1, 0.05
#: The current in precharge.
PRECHARGE_A = 1.0
#: What a charger reports in each stage.
STAGES = {
    State.PRECHARGE_PULSE: (ChargeMode.PRECHARGE, Precharge.PULSE),
    State.PRECHARGE_CONTINUOUS: (ChargeMode.PRECHARGE, Precharge.CONTINUOUS),
    State.CHARGING: (ChargeMode.CHARGE, Precharge.OFF),
}
RESUME = Command(Action.RESUME)


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


def obedient(rules: Rules, shown: Shown, now_s: float, memory: Memory) -> Said:
    """A charger that has just carried out the last decision's command."""
    command = memory.sequence.command
    values = {
        "voltage_v": shown.volts + shown.differs_v if shown.connected else 0.0,
        "control_mode": rules.bay.charger.control, "operation": Operation.STOPPED, "current_step": 0,
        "charge_mode": ChargeMode.FULL, "precharge": Precharge.OFF, "connection": Connection.NORMAL,
    }  # fmt: skip
    if memory.state in ENERGISED:
        values |= _setpoint(memory, manual=rules.manual)
    limit_a = rules.steps_a[int(values["current_step"])] * shown.takes
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
