"""The status document, printed by `status --json` and read by everything north of the service. Its names are fixed.

Values are the newest received, however old: `age_s` gives their age, and values that the core no longer relies on are
`old`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from orchestrator.config.station import Station
from orchestrator.core.facts import CHARGER_STALE_S, FAST_STALE_S, SLOW_STALE_S
from orchestrator.core.limits import present
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import (
    ActiveFault,
    Alarm,
    BatteryReading,
    Cause,
    ChargerReading,
    Decision,
    Measurement,
    Setpoint,
    Snapshot,
)
from orchestrator.service.contactor import Contactor
from orchestrator.service.records import command_fields, session_fields
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import fields

#: The parts of a charger's reading in the status; `t_s` is when it was requested, in monotonic seconds of this machine.
SHOWN = tuple(name for name in ChargerReading.__slots__ if name != "illegal")
#: What the document calls a value otherwise: its names are fixed.
NAMED = {"current_step": "current_limit"}
#: The battery's values that are read several times a second; the others once a second.
FAST = ("voltage_v", "current_a", "status", "temperature_c")


def told(decision: Decision, snapshot: Snapshot, memory: Memory | None, rules: Rules) -> Decision:
    """The decision for people, with the present values in the rule that limits its current.

    A decision keeps that rule as it was when the step was chosen: nothing depends on its figures, and readers are few.
    """
    step, cause = decision.step, decision.cause
    rule = present(step.key, snapshot, memory, rules) if step is not None and memory is not None else None
    if step is None or rule is None:
        return decision
    if cause.id == "charging":
        params = tuple((name, rule if name == "rule" else value) for name, value in cause.params)
        cause = replace(cause, params=params)
    return replace(decision, step=replace(step, rule=rule), cause=cause)


def bay_status(
    name: str, snapshot: Snapshot, decision: Decision, now_s: float, wall_s: float, language: str = "en"
) -> dict[str, object]:
    """The present state of one bay. Values are None if nothing valid is known; `since` is Unix time, like `wall_s`.

    Each cause is included as data; `reason`, `text`, `step_rule` and `result` are its texts in `language`.
    """
    step, session, clock = decision.step, decision.session, WallClock(now_s, wall_s)
    cause = fields(clock.told(decision.cause), language)
    rule = fields(step.rule, language) if step else None
    return {
        "name": name,
        "state": decision.state,
        "reason": _text(cause),
        "cause": cause,
        "step": step.index if step else None,
        "step_current_a": step.current_a if step else None,
        "step_rule": _text(rule),
        "step_cause": rule,
        "step_key": step.key if step else "",
        "step_place": step.place if step else "",
        "command": {**_setpoint(decision.setpoint), "order": command_fields(decision.command)},
        "charger": {
            "online": snapshot.charger_link.online,
            **_problem(snapshot.charger_link.problem, language),
            **_charger(snapshot.charger, now_s),
        },
        "battery": {
            "online": snapshot.battery_link.online,
            **_problem(snapshot.battery_link.problem, language),
            **_battery(snapshot.battery, now_s),
        },
        "faults": [_fault(fault, clock, language) for fault in decision.faults],
        "alarm": _level(decision.alarm),
        "session": session_fields(session, language, clock) if session else None,
    }


def _fault(fault: ActiveFault, clock: WallClock, language: str) -> dict[str, object]:
    """`since`, `gone_since` and `clears_at` are Unix time; `clears` is what ends it: a command, a time, a condition."""
    told, ends = fields(clock.told(fault.told), language), clock.told(fault.next)
    until_s = fault.next.param("until_t_s") if fault.next is not None else None
    return {
        "id": fault.id,
        "effect": fault.effect.name,
        "cause": told,
        "text": _text(told),
        "since": round(clock.unix_s(fault.since_s), 3),
        "gone_since": round(clock.unix_s(fault.gone_s), 3) if fault.gone_s is not None else None,
        "clears": fields(ends, language),
        "clears_at": round(clock.unix_s(until_s), 3) if until_s is not None else None,
    }


def station_status(
    station: Station,
    alarm: Alarm,
    bays: list[dict[str, object]],
    journal_problem: Cause | None,
    not_persisted: Cause | None = None,
    strays: Sequence[Mapping[str, object]] = (),
) -> dict[str, object]:
    """The whole station. `alarm` is the worst of all its bays and strays, even if `bays` has only some of them.

    `strays` are chargers of bays that the station file no longer has.
    """
    return {
        "station": station.station,
        "language": station.language.value,
        "alarm": _level(alarm),
        "bays": bays,
        "strays": list(strays),
        "journal": {
            "directory": str(station.journal.directory.absolute()),
            **_problem(journal_problem, station.language.value),
        },
        "persisted": _problem(not_persisted, station.language.value),
    }


def contactor_fields(contactor: Contactor, language: str) -> dict[str, object]:
    """A contactor as journal and status show it."""
    return {"closed": contactor.closed_s is not None, **_problem(contactor.problem, language)}


def _problem(problem: Cause | None, language: str) -> dict[str, object]:
    """What is wrong, in words and as data; "" and None where nothing is."""
    told = fields(problem, language)
    return {"problem": _text(told), "cause": told}


def _text(told: Mapping[str, object] | None) -> object:
    """The sentence of a cause in this document: making it costs most."""
    return told["text"] if told is not None else ""


def _level(alarm: Alarm) -> str:
    return alarm.name.lower()


def _setpoint(setpoint: Setpoint) -> dict[str, object]:
    return {
        "operation": int(setpoint.run),
        NAMED["current_step"]: setpoint.current_step,
        "charge_mode": setpoint.charge_mode,
        "precharge": setpoint.precharge,
    }


def _charger(reading: ChargerReading | None, now_s: float) -> dict[str, object]:
    age_s = _age_s(reading, now_s)
    return {
        **{NAMED.get(name, name): getattr(reading, name) if reading else None for name in SHOWN},
        "age_s": age_s,
        "old": age_s is not None and age_s > CHARGER_STALE_S,
    }


def _battery(reading: BatteryReading, now_s: float) -> dict[str, object]:
    values: dict[str, Measurement | None] = {name: getattr(reading, name) for name in BatteryReading.__slots__}
    ages_s = {name: _age_s(value, now_s) for name, value in values.items()}
    stale_s = {name: FAST_STALE_S if name in FAST else SLOW_STALE_S for name in values}
    return {
        **{name: value.value if value else None for name, value in values.items()},
        "age_s": ages_s,
        "old": [name for name, age_s in ages_s.items() if age_s is not None and age_s > stale_s[name]],
    }


def _age_s(heard: ChargerReading | Measurement | None, now_s: float) -> float | None:
    return round(now_s - heard.t_s, 3) if heard else None
