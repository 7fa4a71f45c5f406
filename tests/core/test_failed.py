"""Our own exceptions: in one rule, in one decision, in every decision. None of them may keep a charger running."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.core import latches
from orchestrator.core.decide import decide
from orchestrator.core.facts import Facts
from orchestrator.core.failed import carry_on
from orchestrator.core.faults import FAULTS, FaultRow
from orchestrator.core.memory import Memory
from orchestrator.core.persisted import Persisted
from orchestrator.core.rules import Rules
from orchestrator.core.states import ENERGISED, UNVERIFIED
from orchestrator.model import (
    STOP,
    Action,
    Alarm,
    BatteryReading,
    BatteryStatus,
    Cause,
    ChargeMode,
    Connection,
    ControlMode,
    Decision,
    Measurement,
    Operation,
    Precharge,
    Request,
    Snapshot,
    State,
)
from tests.core import world as worlds
from tests.core.bays import IN, charging, idle
from tests.core.said import cause, reason_of, say
from tests.core.world import TICK_S, World

every_state = pytest.mark.parametrize("state", State)
BROKEN = "ZeroDivisionError() in step, line 1"

# --- the decision itself ----------------------------------------------------------------------------------------------


class Switch:
    """While it is on, every decision raises, and the bay is carried on."""

    on = False

    def __call__(self, now_s: float, snapshot: Snapshot, memory: Memory, rules: Rules) -> tuple[Decision, Memory]:
        if self.on:
            return carry_on(now_s, snapshot, memory, BROKEN)
        return decide(now_s, snapshot, memory, rules)


@pytest.fixture
def raises(monkeypatch: pytest.MonkeyPatch) -> Switch:
    switch = Switch()
    monkeypatch.setattr(worlds, "decide", switch)
    return switch


@every_state
def test_a_bay_that_cannot_be_judged_is_stopped_and_given_up_in_three_seconds(raises: Switch, state: State) -> None:
    world = IN[state]()
    raises.on, before = True, len(world.decisions)
    world.run(3.5)
    assert world.is_in(State.UNCONTROLLABLE)
    assert world.decision.alarm is Alarm.DANGER
    assert reason_of(world.decision).startswith(
        "CUT THE MAINS of this charger: this software has failed to judge the bay"
    )
    assert BROKEN in reason_of(world.decision)
    for decision in world.decisions[before:]:
        assert decision.command == STOP
        assert decision.state in (State.STOPPING, State.STARTING, State.UNCONTROLLABLE)
        assert decision.faults[0].id == "internal"
    assert not world.decision.closed
    assert Persisted.of(world.memory, world.now_s).running
    raises.on = False
    world.deaf.clear()
    world.run(9.5)
    assert world.is_in(State.UNCONTROLLABLE)
    world.until(State.TRIPPED, 2.0)
    assert world.decision.alarm is not Alarm.DANGER
    assert world.ask(Request.START) != ""
    assert world.ask(Request.RESET) == ""
    world.run(30)
    assert world.state not in ENERGISED


def test_a_stop_that_was_tried_before_counts(raises: Switch) -> None:
    world = IN[State.STOPPING]()
    world.run(2.0)
    raises.on = True
    world.run(1.25)
    assert world.is_in(State.UNCONTROLLABLE)


def test_the_contactor_breaks_no_load_before_the_stop_has_had_its_time(raises: Switch) -> None:
    world = charging()
    assert world.decision.closed
    raises.on = True
    while not world.is_in(State.UNCONTROLLABLE):
        assert world.decision.closed
        world.tick()
    assert not world.decision.closed


@pytest.mark.parametrize("state", sorted(ENERGISED))
def test_an_exception_in_one_step_trips_and_the_machine_goes_on(raises: Switch, state: State) -> None:
    world = IN[state]()
    raises.on = True
    assert world.tick().state is State.STOPPING
    raises.on = False
    world.until(State.TRIPPED, 2.0)
    assert BROKEN in world.raised["internal"]
    assert len([one for one in world.decisions if one.session is not None and one.session.result]) == 1


@every_state
def test_a_stop_is_heard_meanwhile_and_nothing_else_is(raises: Switch, state: State) -> None:
    world = IN[state]()
    raises.on = True
    world.tick()
    for request in (Request.START, Request.RESET, Request.PAUSE):
        assert "this is a defect of the software" in world.ask(request)
    assert world.ask(Request.STOP) == ""
    raises.on = False
    world.deaf.clear()
    world.run(15)
    assert world.ask(Request.RESET) == ""
    world.run(60)
    assert world.is_in(State.HELD)
    assert world.memory.operator.hold


def test_what_was_known_of_the_bay_is_kept(raises: Switch) -> None:
    world = charging()
    world.battery_link = replace(world.battery_link, implausible={"soc_pct": cause("SOC 140 %")})
    world.tick()
    world.battery_link = replace(world.battery_link, implausible={})
    raises.on = True
    world.run(10)
    raises.on = False
    world.run(15)
    assert {"implausible", "internal"} <= set(world.raised)
    assert len(world.memory.faults["implausible"].strikes) == 1


# --- one rule of the table --------------------------------------------------------------------------------------------


def broken(row: FaultRow) -> Callable[[Facts], Cause | None]:
    def check(_f: Facts) -> Cause | None:
        raise ZeroDivisionError(row.id)

    return check


JUDGED = [row for row in FAULTS if row.id != "internal"]


@pytest.mark.parametrize("row", JUDGED, ids=lambda row: row.id)
def test_a_rule_that_raises_trips_its_bay_and_takes_no_other_with_it(
    monkeypatch: pytest.MonkeyPatch, row: FaultRow
) -> None:
    for state in sorted(row.where - UNVERIFIED - {State.TRIPPED}):  # TRIPPED has already tripped by it
        world = IN[state]()
        world.tick()
        if not world.is_in(state):
            continue
        table = tuple(replace(one, check=broken(one)) if one is row else one for one in FAULTS)
        monkeypatch.setattr(latches, "FAULTS", table)
        other = "error_stop" if row.id != "error_stop" else "system_stop"
        world.shows["charge_mode"] = ChargeMode.ERROR_STOP if other == "error_stop" else ChargeMode.SYSTEM_STOP
        world.tick()
        assert f"{row.id} cannot be judged: ZeroDivisionError('{row.id}')" in world.raised["internal"]
        assert state is State.OFFLINE or world.is_in(State.STOPPING), world.decision
        assert world.decision.command == STOP
        assert other in world.raised
        world.until(State.TRIPPED, 15.0)
        if row.where >= set(State) - {State.STOPPING}:
            assert "internal: reset is refused while it lasts: " in world.ask(Request.RESET)
        monkeypatch.undo()
        world.shows.clear()
        world.run(15)
        assert world.ask(Request.RESET) == ""


# --- whatever is read -------------------------------------------------------------------------------------------------

ODD = st.sampled_from([0.0, -0.0, -1.0, 1e-300, 5e-324, 1e308, -1e308, inf, -inf, nan, 0.1, 48.0, 100.0, 65535.0])
NUMBER = ODD | st.floats(allow_nan=True, allow_infinity=True)


@st.composite
def batteries(draw: st.DrawFn) -> dict[str, tuple[float, float] | None]:
    names = BatteryReading.__slots__
    return {name: draw(st.none() | st.tuples(NUMBER, st.sampled_from([0.0, 0.1, 2.0, -2.0, nan]))) for name in names}


CHARGERS = st.fixed_dictionaries(
    {},
    optional={
        "voltage_v": NUMBER,
        "current_a": NUMBER,
        "operation": st.sampled_from([None, *Operation]),
        "control_mode": st.sampled_from([None, *ControlMode]),
        "charge_mode": st.sampled_from([None, *ChargeMode]),
        "precharge": st.sampled_from([None, *Precharge]),
        "connection": st.sampled_from([None, *Connection]),
        "current_step": st.none() | st.integers(0, 4),
    },
)


@settings(max_examples=150)
@given(
    state=st.sampled_from(list(State)),
    read=st.lists(st.tuples(CHARGERS, batteries(), st.sampled_from([None, *Request])), min_size=1, max_size=6),
)
def test_no_reading_makes_a_step_raise(
    state: State, read: list[tuple[dict[str, object], dict[str, tuple[float, float] | None], Request | None]]
) -> None:
    world = IN[state]()
    for shows, measured, request in read:
        world.now_s += TICK_S
        snapshot = world.snapshot(request, "")
        battery = BatteryReading(
            **{
                name: None if pair is None else Measurement(pair[0], world.now_s - pair[1])
                for name, pair in measured.items()
            }
        )
        charger = snapshot.charger
        assert charger is not None
        snapshot = replace(snapshot, battery=battery, charger=replace(charger, **shows))  # type: ignore[arg-type]  # its fields by name
        decision, world.memory = decide(world.now_s, snapshot, world.memory, world.rules)
        assert "internal" not in {fault.id for fault in decision.faults if "cannot be judged" in say(fault.cause)}
        assert decision.state in ENERGISED or decision.command in (None, STOP)
        assert decision.command is None or decision.command.action in Action
        Persisted.of(world.memory, world.now_s).aged(1.0).memory(5.0)


@pytest.mark.parametrize("number", [0.0, -1.0, 1e-9])
@pytest.mark.parametrize("name", ["voltage_v", "soc_pct", "soh_pct", "remaining_ah", "available_wh"])
def test_a_bmu_that_reads_nothing_is_judged(name: str, number: float) -> None:
    for begin in (idle, charging):
        world = begin()
        world.values |= {"remaining_ah": 10.0, "available_wh": 480.0, "time_to_full_min": 60.0, name: number}
        world.run(5)
        assert "internal" not in world.raised


def test_every_bit_of_a_status_word_is_judged() -> None:
    for word in (-1.0, 2.0**63, 65535.0, float(1 << BatteryStatus.BMU_ERROR)):
        world: World = idle()
        world.values["status"] = word
        world.run(1)
        assert "internal" not in world.raised
