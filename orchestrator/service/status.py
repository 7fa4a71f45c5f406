"""The status document, printed by `status --json` and read by everything north of the service. Its names are fixed.

Values are the newest received, however old: `age_s` gives their age, and values that the core no longer relies on are
`old`.
"""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.config.station import Station
from orchestrator.core.facts import CHARGER_STALE_S, FAST_STALE_S, SLOW_STALE_S
from orchestrator.core.limits import present
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import (
    ActiveFault,
    Alarm,
    BatteryLink,
    BatteryReading,
    Cause,
    ChargerLink,
    ChargerReading,
    Decision,
    Measurement,
    Snapshot,
)
from orchestrator.model.bay_document import BayEntry, BayState, Status, Stray
from orchestrator.model.document import (
    LEVELS,
    VERSION,
    BatteryFields,
    ChargerFields,
    CommandFields,
    ContactorFields,
    Fault,
)
from orchestrator.model.told import Problem, ToldCause
from orchestrator.service.contactor import Contactor
from orchestrator.service.records import command_fields, session_fields
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import fields

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
) -> BayState:
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
        "command": _command(decision),
        "charger": _charger(snapshot.charger_link, snapshot.charger, now_s, language),
        "battery": _battery(snapshot.battery_link, snapshot.battery, now_s, language),
        "faults": [_fault(fault, clock, language) for fault in decision.faults],
        "alarm": _level(decision.alarm),
        "session": session_fields(session, language, clock) if session else None,
    }


def _fault(fault: ActiveFault, clock: WallClock, language: str) -> Fault:
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
    bays: list[BayEntry],
    journal_problem: Cause | None,
    not_persisted: Cause | None = None,
    strays: Sequence[Stray] = (),
    wall_s: float = 0.0,
) -> Status:
    """The whole station. `alarm` is the worst of all its bays and strays, even if `bays` has only some of them.

    `strays` are chargers of bays that the station file no longer has.
    """
    return {
        "version": VERSION,
        "time": round(wall_s, 3),
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


def contactor_fields(contactor: Contactor, language: str) -> ContactorFields:
    """A contactor as journal and status show it."""
    return {"closed": contactor.closed_s is not None, **_problem(contactor.problem, language)}


def _problem(problem: Cause | None, language: str) -> Problem:
    """What is wrong, in words and as data; "" and None where nothing is."""
    told = fields(problem, language)
    return {"problem": _text(told), "cause": told}


def _text(told: ToldCause | None) -> str:
    """The sentence of a cause in this document: making it costs most."""
    return told["text"] if told is not None else ""


def _level(alarm: Alarm) -> str:
    return LEVELS[alarm]


def _command(decision: Decision) -> CommandFields:
    setpoint = decision.setpoint
    return {
        "operation": int(setpoint.run),
        "current_limit": setpoint.current_step,
        "charge_mode": setpoint.charge_mode,
        "precharge": setpoint.precharge,
        "order": command_fields(decision.command),
    }


def _charger(link: ChargerLink, reading: ChargerReading | None, now_s: float, language: str) -> ChargerFields:
    age_s = _age_s(reading, now_s)
    return {
        "online": link.online,
        **_problem(link.problem, language),
        "t_s": reading.t_s if reading else None,
        "voltage_v": reading.voltage_v if reading else None,
        "current_a": reading.current_a if reading else None,
        "control_mode": reading.control_mode if reading else None,
        "operation": reading.operation if reading else None,
        "current_limit": reading.current_step if reading else None,
        "charge_mode": reading.charge_mode if reading else None,
        "precharge": reading.precharge if reading else None,
        "connection": reading.connection if reading else None,
        "age_s": age_s,
        "old": age_s is not None and age_s > CHARGER_STALE_S,
    }


def _battery(link: BatteryLink, reading: BatteryReading, now_s: float, language: str) -> BatteryFields:
    values: dict[str, Measurement | None] = {name: getattr(reading, name) for name in BatteryReading.__slots__}
    ages_s = {name: _age_s(value, now_s) for name, value in values.items()}
    stale_s = {name: FAST_STALE_S if name in FAST else SLOW_STALE_S for name in values}
    return {
        "online": link.online,
        **_problem(link.problem, language),
        "voltage_v": _value(reading.voltage_v),
        "current_a": _value(reading.current_a),
        "status": _value(reading.status),
        "temperature_c": _value(reading.temperature_c),
        "soc_pct": _value(reading.soc_pct),
        "soh_pct": _value(reading.soh_pct),
        "time_to_full_min": _value(reading.time_to_full_min),
        "time_to_empty_min": _value(reading.time_to_empty_min),
        "remaining_ah": _value(reading.remaining_ah),
        "available_wh": _value(reading.available_wh),
        "age_s": ages_s,
        "old": [name for name, age_s in ages_s.items() if age_s is not None and age_s > stale_s[name]],
    }


def _value(measured: Measurement | None) -> float | None:
    return measured.value if measured else None


def _age_s(heard: ChargerReading | Measurement | None, now_s: float) -> float | None:
    return round(now_s - heard.t_s, 3) if heard else None
