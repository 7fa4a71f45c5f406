"""A bay's journal records: readable for people, complete for a replay."""

import json
import zlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
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
    Sent,
    Session,
    Snapshot,
    State,
)
from orchestrator.service.journal import _line
from orchestrator.service.records import WHOLE_S, SnapshotRecorder, TimedLine, decision_lines
from orchestrator.workbench.replay.recording import read
from tests.core.bays import charging
from tests.core.said import cause, reason_of
from tests.service.bench import Bench, fields_of, the_bay

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


def reread(lines: Iterable[TimedLine], directory: Path) -> list[tuple[float, Snapshot]]:
    """The decisions' times and snapshots, as a reader of the journal finds them."""
    path = directory / "snapshots.jsonl"
    path.write_bytes(b"".join(_line((t_s, 1_700_000_000.0 + t_s, "bay-1", line)) for t_s, line in lines))
    record = read([path])
    assert not record.broken
    return [(one.at_s, one.snapshot) for one in record.bays.get("bay-1", [])]


def lines_for(steps: Iterable[tuple[float, Snapshot]], *, news: bool = False) -> list[TimedLine]:
    recorder, memory = SnapshotRecorder(BAY), Memory()
    lines = [
        line for at_s, snapshot in steps for line in recorder.lines(at_s, snapshot, memory, State.CHARGING, news=news)
    ]
    return lines + recorder.rest()


READING = ChargerReading(
    1.0, 48.0, 0.0, ControlMode.MANUAL, Operation.STOPPED, 0, ChargeMode.FULL, Precharge.OFF, Connection.NORMAL
)
#: Whole milliseconds, and times that are none.
times = st.one_of(
    st.sampled_from([1.0, 2.0, 2.001, 0.1 + 0.2, 0.3, 12345.678, 37048.010390211, 0.0]), st.floats(0, 1e6)
)
numbers = st.one_of(st.sampled_from([20.0, 21.0, 0.0, -0.0, 0.1]), st.floats(allow_nan=False, allow_infinity=False))
measurements = st.none() | st.builds(Measurement, numbers, times)
readings = st.builds(
    replace, st.just(READING), t_s=times, voltage_v=numbers, charge_mode=st.sampled_from([None, ChargeMode.CHARGE]),
    illegal=st.sampled_from([(), (cause("mode 9"),)]),
)  # fmt: skip
snapshots = st.builds(
    Snapshot,
    st.none() | readings,
    st.builds(
        ChargerLink,
        online=st.booleans(),
        problem=st.sampled_from([None, cause("gone")]),
        sent=st.sampled_from([None, Sent(STOP, 1.0), Sent(STOP, 1.5), Sent(Command(Action.SET_LIMIT, 3), 1.5)]),
        stop_sent_s=st.none() | times,
        bad_pct=numbers,
    ),
    st.builds(BatteryReading, soc_pct=measurements, temperature_c=measurements, voltage_v=measurements),
    st.builds(
        BatteryLink,
        heartbeat_t_s=st.none() | times,
        implausible=st.sampled_from([{}, {"soc_pct": cause("140")}]),
        nmt_state=st.sampled_from([None, 5]),
    ),
    st.sampled_from([None, *Request]),
    st.sampled_from(["", "broken"]),
    late_s=numbers,
    not_persisted=st.sampled_from([None, cause("the disk is full")]),
    connected=st.booleans(),
    moves=st.sampled_from(["", "bay-2"]),
)


@given(st.lists(st.tuples(times, snapshots), max_size=12), st.booleans())
def test_every_snapshot_is_read_back_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[float, Snapshot]], news: bool
) -> None:
    steps = sorted(steps, key=lambda step: step[0])
    found = reread(lines_for(steps, news=news), tmp_path_factory.mktemp("rows"))
    assert repr(found) == repr(steps), "repr tells 0.0 from -0.0, and 1 from 1.0"


def charging_rows(count: int, began_s: float = 1000.0) -> list[tuple[float, Snapshot]]:
    """Decisions of a steady charge, five a second."""
    rows = []
    for number in range(count):
        at_s = (round(began_s * 1000) + 200 * number) / 1000
        value = Measurement(48.0, at_s)
        battery = BatteryReading(voltage_v=value, current_a=value, soc_pct=Measurement(50.0, float(int(at_s))))
        rows.append((at_s, Snapshot(replace(READING, t_s=at_s), battery=battery)))
    return rows


def test_a_complete_line_with_memory_and_rules_comes_every_ten_minutes() -> None:
    lines = lines_for(charging_rows(round(2 * WHOLE_S * 5) + 10))
    whole = [t_s for t_s, line in lines if fields_of(line).get("whole")]
    assert whole == [1000.0, 1000.0 + WHOLE_S, 1000.0 + 2 * WHOLE_S]
    first = json.loads(json.dumps(fields_of(lines[0][1])))
    assert "state" in first["memory"]
    assert first["config"]["policy"]["policy"] == "li-ion-48v"


def test_decisions_share_a_line_for_a_few_seconds_or_until_something_happens() -> None:
    recorder, rows = SnapshotRecorder(BAY), charging_rows(60)
    written = [
        number
        for number, (at_s, snapshot) in enumerate(rows)
        if recorder.lines(at_s, snapshot, Memory(), State.CHARGING, news=number == 40)
    ]
    assert written == [0, 26, 40]


def test_a_row_of_a_steady_charge_costs_a_few_bytes() -> None:
    """Five values that have only become newer."""
    lines = lines_for(charging_rows(100))
    data = b"".join(_line((t_s, 0.0, "bay-1", line)) for t_s, line in lines[1:])
    assert len(data) / 99 < 40
    assert len(zlib.compress(data)) / 99 < 6


def test_a_quiet_bay_says_nothing_until_something_happens() -> None:
    recorder = SnapshotRecorder(BAY)

    def lines(state: State, *, request: Request | None = None, news: bool = False) -> list[TimedLine]:
        return recorder.lines(1.0, Snapshot(request=request), Memory(), state, news=news)

    for state in QUIET:
        assert lines(state) == []
    assert len(lines(State.IDLE, request=Request.START)) == 1
    assert lines(State.IDLE) == []
    ((_, line),) = lines(State.IDLE, news=True)
    assert fields_of(line)["whole"]
    assert lines(State.STARTING) == []
    ((t_s, line),) = lines(State.IDLE)
    assert (t_s, fields_of(line)["at"]) == (1.0, []), "what waited for more is written when it becomes quiet"


def test_a_whole_charge_can_be_read_back(tmp_path: Path) -> None:
    """From the first decision to the end of a charge: no snapshot is lost, none is changed."""
    bench = Bench(tmp_path)
    seen, busy = dict[float, Snapshot](), set[float]()

    def step_and_look() -> State:
        state = bench.step()
        seen[bench.now_s] = bench.bay._snapshot
        if state not in QUIET:
            busy.add(bench.now_s)
        return state

    for _ in range(60):
        step_and_look()
    assert bench.charger.reading.current_a > 0
    bench.battery.values["soc_pct"] = 100.0
    assert State.FULL in [step_and_look() for _ in range(30)]
    waiting = bench.journal._waiting
    found = reread([(t_s, line) for t_s, _, _, line in waiting[True]], tmp_path)
    assert found == [(at_s, seen[at_s]) for at_s, _ in found]
    assert {at_s for at_s, _ in found} >= busy
    lines = [(line[0], fields_of(line)) for _, _, _, line in waiting[False]]
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
