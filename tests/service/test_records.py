"""A bay's journal records: readable for people, complete for a replay."""

import json
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from orchestrator.core.memory import Memory
from orchestrator.core.states import QUIET
from orchestrator.model import (
    STOP,
    Account,
    Action,
    ActiveFault,
    BatteryLink,
    BatteryReading,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    CurrentStep,
    Decision,
    Effect,
    Measurement,
    Operation,
    Precharge,
    Request,
    Session,
    Snapshot,
    State,
)
from orchestrator.service.records import WHOLE_EVERY, SnapshotRecorder, decision_lines
from tests.core.bays import charging
from tests.core.said import cause, reason_of
from tests.service.bench import Bench, the_bay

BAY = the_bay()
NO_BATTERY = cause("no battery")
IDLE = Decision(State.IDLE, NO_BATTERY)
HOT = ActiveFault("hot_trip", Effect.TRIP, 3.0, lambda: Account(cause("the pack has 56.0 °C")))


def both(text: str, name: str = "reason") -> dict[str, object]:
    """The sentence and its cause."""
    said = {"id": "said", "params": {"text": text}, "key": "", "place": "", "advice": ""}
    return {name: text, "cause": said}


def kinds(before: Decision | None, now: Decision) -> dict[str, Any]:
    return dict(decision_lines(before, now))


def test_the_first_decision_says_where_the_bay_begins() -> None:
    assert kinds(None, IDLE) == {
        "transition": {"from": None, "to": "IDLE", **both("no battery")},
        "command": {"action": None},
        "decision": {"state": "IDLE", **both("no battery"), "step": None},
    }


def test_nothing_new_says_nothing() -> None:
    charging = Decision(State.CHARGING, cause("step 4"), step=CurrentStep(4, 14.0, cause("rule")), session=Session(1.0))
    longer = replace(charging, cause=cause("step 4, a second later"), session=Session(1.0, elapsed_s=1.0))
    assert kinds(charging, longer) == {}


def test_a_change_of_state_of_order_and_of_step() -> None:
    stopping = Decision(State.STOPPING, cause("hot"), STOP)
    assert kinds(IDLE, stopping) == {
        "transition": {"from": "IDLE", "to": "STOPPING", **both("hot")},
        "command": {"action": "stop", "value": 0},
        "decision": {"state": "STOPPING", **both("hot"), "step": None},
    }
    four = Decision(
        State.CHARGING, cause("a"), Command(Action.SET_LIMIT, 4), step=CurrentStep(4, 14.0, cause("rule of four"))
    )
    three = replace(four, command=Command(Action.SET_LIMIT, 3), step=CurrentStep(3, 11.0, cause("rule of three")))
    assert kinds(four, three) == {
        "command": {"action": "set_limit", "value": 3},
        "decision": {
            "state": "CHARGING",
            **both("a"),
            "step": {"index": 3, "current_a": 11.0, **both("rule of three", "rule")},
        },
    }


def test_a_fault_comes_gets_worse_and_goes() -> None:
    warm = replace(HOT, effect=Effect.PAUSE, account=lambda: Account(cause("the pack has 46 °C")))
    hotter = replace(warm, account=lambda: Account(cause("the pack has 47 °C")))
    fields = {"id": "hot_trip", "event": "raised", "effect": "PAUSE", **both("the pack has 46 °C", "text")}
    assert kinds(IDLE, replace(IDLE, faults=(warm,))) == {"fault": fields}
    assert kinds(replace(IDLE, faults=(warm,)), replace(IDLE, faults=(hotter,))) == {}
    assert kinds(replace(IDLE, faults=(warm,)), replace(IDLE, faults=(HOT,)))["fault"]["effect"] == "TRIP"
    assert kinds(replace(IDLE, faults=(HOT,)), IDLE)["fault"]["event"] == "cleared"


def test_a_session_begins_and_ends_once() -> None:
    begun = replace(IDLE, session=Session(1.0, soc_start_pct=50.0))
    assert kinds(IDLE, begun)["session"]["event"] == "begin"
    going = replace(IDLE, session=Session(1.0, elapsed_s=9.0))
    assert kinds(begun, going) == {}
    ended = replace(IDLE, session=Session(1.0, elapsed_s=9.06, charged_ah=1.23456789, result=cause("full")))
    assert kinds(going, ended)["session"] == {
        "event": "end",
        "elapsed_s": 9.1,
        "energised_s": 0.0,
        "charged_ah": 1.2346,
        "charged_wh": 0.0,
        "soc_start_pct": None,
        "soc_pct": None,
        "step_changes": 0,
        **both("full", "result"),
    }
    assert kinds(ended, IDLE) == {}
    assert kinds(ended, begun)["session"]["event"] == "begin"


# --- snapshots -------------------------------------------------------------------------------------------------------


def plain(snapshot: Snapshot) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(json.dumps(causes_plain(asdict(snapshot))))
    return document


def causes_plain(value: Any) -> Any:
    """Causes as the journal has them: with their parameters as an object."""
    if isinstance(value, dict):
        found = {name: causes_plain(one) for name, one in value.items()}
        return {**found, "params": dict(found["params"])} if "params" in found else found
    return [causes_plain(one) for one in value] if isinstance(value, list | tuple) else value


def rebuilt(lines: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """The snapshots a reader builds from the lines, knowing them only as JSON."""
    snapshots: list[dict[str, Any]] = []
    for line in lines:
        fields = json.loads(json.dumps(line))
        if fields.pop("whole", False):
            for name in ("memory", "config", "at_s"):
                fields.pop(name)
            snapshots.append(fields)
        else:
            battery = {**snapshots[-1]["battery"], **fields.pop("battery", {})}
            fields.pop("at_s")
            snapshots.append({**snapshots[-1], **fields, "battery": battery})
    return snapshots


READING = ChargerReading(
    1.0, 48.0, 0.0, ControlMode.MANUAL, Operation.STOPPED, 0, ChargeMode.FULL, Precharge.OFF, Connection.NORMAL
)
measurements = st.none() | st.builds(Measurement, st.sampled_from([20.0, 21.0]), st.sampled_from([1.0, 2.0]))
snapshots = st.builds(
    Snapshot,
    st.sampled_from(
        [None, READING, replace(READING, t_s=2.0), replace(READING, charge_mode=None, illegal=(cause("mode 9"),))]
    ),
    st.sampled_from(
        [ChargerLink(), ChargerLink(online=True), ChargerLink(problem=cause("gone")), ChargerLink(online=True)]
    ),
    st.builds(BatteryReading, soc_pct=measurements, temperature_c=measurements, voltage_v=measurements),
    st.sampled_from([BatteryLink(), BatteryLink(online=True, implausible={"soc_pct": cause("140")})]),
    st.sampled_from([None, *Request]),
    st.sampled_from(["", "broken"]),
    st.booleans(),
    st.sampled_from(["", "the line is gone"]),
)


@given(st.lists(snapshots, max_size=12))
def test_the_lines_are_enough_to_rebuild_every_snapshot(steps: list[Snapshot]) -> None:
    recorder, lines = SnapshotRecorder(BAY), []
    for snapshot in steps:
        line = recorder.line(1.0, snapshot, Memory(), State.CHARGING, news=False)
        assert line is not None
        lines.append(line[1])
    assert rebuilt(lines) == [plain(snapshot) for snapshot in steps]


def test_a_whole_line_with_the_memory_comes_now_and_then() -> None:
    recorder = SnapshotRecorder(BAY)
    lines = [
        recorder.line(float(number), Snapshot(), Memory(), State.CHARGING, news=False)
        for number in range(2 * WHOLE_EVERY + 4)
    ]
    whole = [number for number, line in enumerate(lines) if line is not None and line[1].get("whole")]
    assert whole == [0, WHOLE_EVERY + 1, 2 * (WHOLE_EVERY + 1)]
    assert lines[0] is not None
    first = json.loads(json.dumps(lines[0][1]))
    assert "state" in first["memory"]
    assert first["config"]["policy"]["policy"] == "li-ion-48v"
    assert [line[1]["at_s"] for line in lines if line is not None] == list(range(2 * WHOLE_EVERY + 4))


def test_a_quiet_bay_says_nothing_until_something_happens() -> None:
    recorder = SnapshotRecorder(BAY)
    for state in QUIET:
        assert recorder.line(1.0, Snapshot(), Memory(), state, news=False) is None
    assert recorder.line(1.0, Snapshot(request=Request.START), Memory(), State.IDLE, news=False) is not None
    assert recorder.line(1.0, Snapshot(), Memory(), State.IDLE, news=False) is None
    line = recorder.line(1.0, Snapshot(), Memory(), State.IDLE, news=True)
    assert line is not None
    assert line[1]["whole"]


def test_a_whole_charge_can_be_read_back(tmp_path: Path) -> None:
    """From the first decision to the end of a charge: every line is JSON, and no snapshot is lost."""
    bench = Bench(tmp_path)
    journal, seen = bench.journal, list[dict[str, Any]]()

    def step_and_look() -> State:
        before = len(journal._waiting)
        state = bench.step()
        if any(entry[3][0] == "snapshot" for entry in list(journal._waiting)[before:]):
            seen.append(plain(bench.bay._snapshot))
        return state

    for _ in range(60):
        step_and_look()
    assert bench.charger.reading.current_a > 0
    bench.battery.values["soc_pct"] = 100.0
    assert State.FULL in [step_and_look() for _ in range(30)]
    lines = [json.loads(json.dumps(entry[3])) for entry in journal._waiting]
    assert rebuilt(fields for kind, fields in lines if kind == "snapshot") == seen
    path = [fields["to"] for kind, fields in lines if kind == "transition"]
    assert path == ["STARTING", "IDLE", "QUALIFYING", "CHARGING", "STOPPING", "FULL"]
    assert [fields["event"] for kind, fields in lines if kind == "session"] == ["begin", "end"]


def test_a_countdown_is_no_news() -> None:
    """The reason of a backoff says when it ends: a new text each second, but not a single journal line."""
    world = charging()
    world.battery_link = replace(world.battery_link, implausible={"soc_pct": cause("SOC 140 %")})
    world.tick()
    world.battery_link = replace(world.battery_link, implausible={})
    world.run(5)
    assert world.state is State.SUSPENDED
    reasons = set()
    for _ in range(8):
        before = world.decision
        reasons.add(reason_of(world.run(1)))
        assert list(decision_lines(before, world.decision)) == []
    assert len(reasons) == 8
    assert all("goes on by itself in" in reason for reason in reasons)
