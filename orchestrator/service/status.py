"""The status document: what `status --json` prints and everything north of the service reads. Its names are fixed."""

from collections.abc import Mapping, Sequence

from orchestrator.config.station import Station
from orchestrator.model import BatteryReading, ChargerReading, Decision, Measurement, Setpoint, Snapshot
from orchestrator.service.records import command_fields, session_fields

#: What of a charger's reading the status shows; `t_s` is when it was asked for, in monotonic seconds of this machine.
SHOWN = tuple(name for name in ChargerReading.__slots__ if name != "illegal")


def bay_status(name: str, snapshot: Snapshot, decision: Decision, now_s: float, wall_s: float) -> dict[str, object]:
    """One bay. Values are None where nothing valid is known; `since` is Unix time."""
    return {
        "name": name,
        "state": decision.state,
        "reason": decision.reason,
        "step": decision.step.index if decision.step else None,
        "step_current_a": decision.step.current_a if decision.step else None,
        "step_rule": decision.step.rule if decision.step else "",
        "command": {**_setpoint(decision.setpoint), "order": command_fields(decision.command)},
        "charger": {
            "online": snapshot.charger_link.online,
            "problem": snapshot.charger_link.problem,
            **_charger(snapshot.charger),
        },
        "battery": {
            "online": snapshot.battery_link.online,
            "problem": snapshot.battery_link.problem,
            **_battery(snapshot.battery),
        },
        "faults": [
            {
                "id": fault.id,
                "effect": fault.effect.name,
                "text": fault.text,
                "since": round(wall_s - (now_s - fault.since_s), 3),
            }
            for fault in decision.faults
        ],
        "alarm": decision.alarm,
        "session": session_fields(decision.session) if decision.session else None,
    }


def station_status(
    station: Station,
    bays: list[dict[str, object]],
    journal_problem: str,
    unkept: str = "",
    strays: Sequence[Mapping[str, object]] = (),
) -> dict[str, object]:
    """The whole station. `strays` are chargers of bays that the station file has not any more."""
    return {
        "station": station.station,
        "bays": bays,
        "strays": list(strays),
        "journal": {"problem": journal_problem},
        "persisted": {"problem": unkept},
    }


def _setpoint(setpoint: Setpoint) -> dict[str, object]:
    return {
        "operation": int(setpoint.run),
        "current_limit": setpoint.current_limit,
        "charge_mode": setpoint.charge_mode,
        "precharge": setpoint.precharge,
    }


def _charger(reading: ChargerReading | None) -> dict[str, object]:
    return {name: getattr(reading, name) if reading else None for name in SHOWN}


def _battery(reading: BatteryReading) -> dict[str, object]:
    values: dict[str, Measurement | None] = {name: getattr(reading, name) for name in BatteryReading.__slots__}
    return {name: value.value if value else None for name, value in values.items()}
