"""The status document: fixed names, JSON values, null for unknown."""

import json
from pathlib import Path
from typing import Any

import pytest

from orchestrator.config.load import load_station
from orchestrator.config.shipped import shipped_dir
from orchestrator.core.facts import CHARGER_STALE_S, SLOW_STALE_S
from orchestrator.core.memory import Memory
from orchestrator.model import (
    Account,
    ActiveFault,
    Alarm,
    BatteryLink,
    BatteryReading,
    Cause,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Connection,
    ControlMode,
    CurrentStep,
    Decision,
    Effect,
    Measurement,
    Operation,
    Precharge,
    Session,
    Setpoint,
    Snapshot,
    State,
)
from orchestrator.model.bay_document import Stray
from orchestrator.service.status import bay_status, station_status
from orchestrator.text.catalogue import fields
from tests.core.said import cause

READING = ChargerReading(
    1.0, 50.11, 13.9, ControlMode.MANUAL, Operation.RUNNING, 4, ChargeMode.CHARGE, Precharge.OFF, Connection.NORMAL
)
CHARGING = Decision(
    State.CHARGING,
    cause("step 4"),
    setpoint=Setpoint(True, 4, ChargeMode.CHARGE, Precharge.OFF),
    step=CurrentStep(4, 14.0, cause("limits.current_a")),
    faults=(
        ActiveFault(
            "noisy_line",
            Effect.WARN,
            90.0,
            lambda: Account(Cause.of("noisy_line", bad_pct=9.4, limit_pct=5.0).with_("noisy_line", effect="WARN")),
        ),
    ),
    session=Session(10.0, elapsed_s=90.0, charged_ah=0.5),
)
KNOWN = Snapshot(
    READING,
    ChargerLink(online=True),
    BatteryReading(soc_pct=Measurement(51.0, 1.0), temperature_c=Measurement(20.5, 1.0)),
    BatteryLink(online=True),
)


def document(snapshot: Snapshot, decision: Decision) -> dict[str, Any]:
    """The document as received by a client of the socket."""
    status: dict[str, Any] = json.loads(json.dumps(bay_status("bay-1", snapshot, decision, 100.0, 1000.0)))
    return status


def test_the_fixed_names_are_there_whatever_is_known() -> None:
    for status in (document(Snapshot(), Decision(State.STARTING, Memory().cause)), document(KNOWN, CHARGING)):
        assert {"name", "state", "reason", "step", "command", "charger", "battery", "faults", "session"} <= set(status)
        assert set(status["charger"]) >= {
            "online",
            "voltage_v",
            "current_a",
            "control_mode",
            "operation",
            "current_limit",
            "charge_mode",
            "precharge",
            "connection",
        }
        assert set(status["battery"]) >= {
            "online",
            "soc_pct",
            "soh_pct",
            "temperature_c",
            "voltage_v",
            "current_a",
            "status",
        }


def test_nothing_known_is_null() -> None:
    status = document(Snapshot(), Decision(State.STARTING, Memory().cause))
    for part, old in (("charger", False), ("battery", [])):
        known = {key: value for key, value in status[part].items() if key not in ("online", "problem")}
        assert known.pop("old") == old
        ages_s = known.pop("age_s")
        assert {*known.values(), *(ages_s.values() if ages_s else (ages_s,))} == {None}
    assert (status["step"], status["session"], status["faults"], status["alarm"]) == (None, None, [], "none")


def test_what_is_known_is_in_the_devices_own_values() -> None:
    status = document(KNOWN, CHARGING)
    assert status["state"] == "CHARGING"
    assert (status["step"], status["step_current_a"], status["step_rule"]) == (4, 14.0, "limits.current_a")
    assert status["command"] == {
        "operation": 1,
        "current_limit": 4,
        "charge_mode": 4,
        "precharge": 0,
        "order": {"action": None},
    }
    assert (status["charger"]["voltage_v"], status["charger"]["operation"], status["charger"]["charge_mode"]) == (
        50.11,
        1,
        4,
    )
    assert (status["battery"]["soc_pct"], status["battery"]["soh_pct"]) == (51.0, None)
    assert status["session"]["charged_ah"] == 0.5


@pytest.mark.parametrize(
    ("age_s", "charger_old", "battery_old"),
    [
        (0.0, False, []),
        (CHARGER_STALE_S, False, []),
        (CHARGER_STALE_S + 0.1, True, ["temperature_c"]),
        (SLOW_STALE_S + 0.1, True, ["temperature_c", "soc_pct"]),
    ],
)
def test_each_value_says_how_old_it_is_and_whether_it_still_counts(
    age_s: float, charger_old: bool, battery_old: list[str]
) -> None:
    status = bay_status("bay-1", KNOWN, CHARGING, 1.0 + age_s, 1000.0)
    assert status["charger"]["age_s"] == pytest.approx(age_s)
    assert status["charger"]["old"] is charger_old
    assert status["charger"]["current_a"] == 13.9
    assert status["battery"]["age_s"]["soc_pct"] == pytest.approx(age_s)
    assert status["battery"]["age_s"]["voltage_v"] is None
    assert status["battery"]["old"] == battery_old


def test_since_is_the_wall_clock() -> None:
    (fault,) = document(KNOWN, CHARGING)["faults"]
    assert fault["since"] == 990.0


def test_a_cause_is_data_and_a_sentence_in_the_stations_language() -> None:
    (fault,) = document(KNOWN, CHARGING)["faults"]
    text = "9 % of the last minute's exchanges with the charger go wrong, more than 5 %; check the cable, its shield "
    text += "and its ground"
    cause = {
        "id": "noisy_line",
        "params": {"bad_pct": 9.4, "limit_pct": 5.0, "effect": "WARN"},
        "key": "",
        "place": "",
        "advice": "noisy_line",
        "text": text,
    }
    assert fault == {"id": "noisy_line", "effect": "WARN", "cause": cause, "text": text, "since": 990.0,
                     "gone_since": None, "clears": None, "clears_at": None}  # fmt: skip
    status = document(KNOWN, CHARGING)
    assert (status["reason"], status["cause"]["text"], status["cause"]["id"]) == ("step 4", "step 4", "said")
    (korean,) = json.loads(json.dumps(bay_status("bay-1", KNOWN, CHARGING, 100.0, 1000.0, "ko")))["faults"]
    assert korean["text"] != text
    assert korean["cause"]["params"] == cause["params"]


def test_the_station_tells_its_name_its_bays_and_its_journals_problem() -> None:
    station = load_station(shipped_dir() / Path("configs/stations/one-bay.yaml"))
    stray: Stray = {
        "bay": "bay-9", "port": "/dev/x", "state": "STOPPING", "verified": False, "problem": "", "cause": None,
    }  # fmt: skip
    status = station_status(station, Alarm.DANGER, [], cause("disk full"), cause("worn"), [stray], 1000.0)
    assert {**status} == {
        "version": 1,
        "time": 1000.0,
        "station": "depot-1",
        "language": "en",
        "alarm": "danger",
        "bays": [],
        "strays": [stray],
        "journal": {
            "directory": str(station.journal.directory.absolute()),
            "problem": "disk full",
            "cause": fields(cause("disk full")),
        },
        "persisted": {"problem": "worn", "cause": fields(cause("worn"))},
    }
