"""`decide()` with any possible input: it never raises, never changes its arguments, never runs blindly."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache, partial
from math import isfinite
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.core.states import ENERGISED
from orchestrator.model import (
    STANDBY,
    STOP,
    Action,
    Alarm,
    BatteryLink,
    BatteryReading,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    Decision,
    Effect,
    Measurement,
    Operation,
    Precharge,
    Request,
    Sent,
    Snapshot,
    State,
)
from tests.core.bays import IN, charging
from tests.core.fault_scenes import SCENES
from tests.core.said import cause, reason_of
from tests.core.world import World, bay

NEEDED = ("voltage_v", "current_a", "status", "temperature_c", "soc_pct", "soh_pct")

# --- possible inputs --------------------------------------------------------------------------------------------------

#: How long ago a value was requested: mostly fresh, some stale, some in the future.
ages = st.sampled_from([0.0, 0.0, 0.0, 0.1, 1.0, 1.5, 1.6, 3.1, 1e6, -0.01, -5.0])
numbers = st.one_of(
    st.sampled_from([0.0, 48.0, 20.0, 50.0, 100.0, -1.0, 2.0, 14.0, 26.0, 33.0, 55.2, 58.4, 1e308, -1e308]),
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(0, 100),
)


@st.composite
def readings(draw: st.DrawFn, now_s: float) -> ChargerReading | None:
    if draw(st.integers(0, 9)) == 0:
        return None
    return ChargerReading(
        t_s=now_s - draw(ages),
        voltage_v=draw(numbers),
        current_a=draw(numbers),
        control_mode=draw(st.sampled_from([None, *ControlMode])),
        operation=draw(st.sampled_from([None, *Operation])),
        current_step=draw(st.sampled_from([None, 0, 1, 2, 3, 4])),
        charge_mode=draw(st.sampled_from([None, *ChargeMode])),
        precharge=draw(st.sampled_from([None, *Precharge])),
        connection=draw(st.sampled_from([None, *Connection])),
        illegal=draw(st.sampled_from([(), (), (cause("charge mode 9"),)])),
    )


@st.composite
def lines(draw: st.DrawFn, now_s: float) -> ChargerLink:
    times = st.one_of(st.none(), ages.map(lambda age: now_s - age))
    command = st.builds(Command, st.sampled_from(Action), st.integers(0, 5))
    return ChargerLink(
        online=draw(st.booleans()),
        problem=draw(st.sampled_from([None, None, cause("no such port")])),
        misses=draw(st.integers(0, 5)),
        sent=draw(st.one_of(st.none(), st.builds(Sent, command, ages.map(lambda age: now_s - age)))),
        stop_sent_s=draw(times),
        refused=draw(st.sampled_from([None, cause("run: too hot")])),
        error_bits=draw(st.integers(0, 255)),
        error_t_s=draw(times),
        bad_frames=draw(st.integers(0, 9)),
    )


@st.composite
def batteries(draw: st.DrawFn, now_s: float) -> tuple[BatteryReading, BatteryLink]:
    values = {name: Measurement(draw(numbers), now_s - draw(ages)) for name in NEEDED if draw(st.integers(0, 9)) > 0}
    times = st.one_of(st.none(), ages.map(lambda age: now_s - age))
    return BatteryReading(**values), BatteryLink(
        online=draw(st.booleans()),
        problem=draw(st.sampled_from([None, cause("no answer")])),
        boots=draw(st.integers(0, 2)),
        boot_t_s=draw(times),
        heartbeat_s=draw(st.sampled_from([None, 0.5])),
        heartbeat_t_s=draw(times),
        abort=draw(st.sampled_from([None, None, cause("0x6004: refused")])),
        abort_code=draw(st.sampled_from([0, 0x06020000, 0x08000022])),
        implausible=draw(
            st.sampled_from([{}, {}, {"soc_pct": cause("SOC 255 %")}, {"temperature_c": cause("3276.7 °C")}])
        ),
        emergency=draw(st.sampled_from([None, None, cause("EMCY 0x1000")])),
    )


@st.composite
def snapshots(draw: st.DrawFn, now_s: float) -> Snapshot:
    battery, battery_link = draw(batteries(now_s))
    return Snapshot(
        charger=draw(readings(now_s)),
        charger_link=draw(lines(now_s)),
        battery=battery,
        battery_link=battery_link,
        request=draw(st.sampled_from([None, None, None, *Request])),
        internal=draw(st.sampled_from(["", "", "", "KeyError()"])),
    )


def mixed(draw: st.DrawFn, good: Any, wild: Any) -> Any:
    """The good record; one time in four with a field of the wild one."""
    if wild is None or draw(st.integers(0, 3)):
        return good
    name = draw(st.sampled_from([field.name for field in fields(good)]))
    return replace(good, **{name: getattr(wild, name)})


@st.composite
def nearly_good(draw: st.DrawFn, now_s: float, world: World) -> Snapshot:
    """The world's values, some of them replaced by anything."""
    good, wild = world.snapshot(None, ""), draw(snapshots(now_s))
    assert good.charger is not None
    shown = {
        "operation": draw(st.sampled_from([*Operation])),
        "current_step": draw(st.sampled_from([0, 4, 2])),
        "charge_mode": draw(st.sampled_from([ChargeMode.CHARGE, ChargeMode.PRECHARGE, ChargeMode.FULL])),
        "precharge": draw(st.sampled_from([*Precharge])),
    }
    values = {name: replace(value, t_s=now_s) for name, value in world.measured.items()}
    sent = Sent(Command(Action.RESUME), now_s - 0.01)
    link = replace(good.charger_link, stop_sent_s=now_s, sent=sent, problem=None)
    return Snapshot(
        charger=mixed(draw, replace(good.charger, t_s=now_s, **shown), wild.charger),
        charger_link=mixed(draw, link, wild.charger_link),
        battery=mixed(draw, BatteryReading(**values), wild.battery),
        battery_link=mixed(draw, replace(good.battery_link, online=True), wild.battery_link),
        request=draw(st.sampled_from([*[None] * 12, *Request])),
        internal=wild.internal if draw(st.integers(0, 9)) == 0 else "",
    )


#: The states in which something may go wrong come up more often.
states = st.sampled_from([*State, *sorted(ENERGISED) * 3, *[State.QUALIFYING] * 3])

# --- what must hold after every decision ------------------------------------------------------------------------------

RULES = {control: Rules.of(bay(control=control, current_a=12.0)) for control in ControlMode}


beginning = cache(lambda state: IN[state]())  # a world in that state


def fresh(snapshot: Snapshot, now_s: float) -> bool:
    """Whether everything that a charge is decided by is a fresh number."""
    reading, battery = snapshot.charger, snapshot.battery
    values = [getattr(battery, name) for name in NEEDED]
    if reading is None or any(value is None for value in values):
        return False
    numbers = (reading.voltage_v, reading.current_a, *(value.value for value in values))
    times = (reading.t_s, *(value.t_s for value in values))
    return all(map(isfinite, numbers)) and all(abs(now_s - t_s) <= 3.0 for t_s in times)


def check(before: Memory, now_s: float, snapshot: Snapshot, decision: Decision, rules: Rules) -> None:
    state, command, shown = decision.state, decision.command, snapshot.charger
    assert (decision.alarm is Alarm.DANGER) is (state is State.UNCONTROLLABLE)
    assert reason_of(decision)
    effects = [fault.effect for fault in decision.faults]
    assert effects == sorted(effects, reverse=True)
    if state not in ENERGISED:
        assert command in (None, STOP)
        assert (decision.setpoint, decision.step) == (STANDBY, None)
        return
    assert before.state in ENERGISED | {State.QUALIFYING}
    assert not effects or effects[0] < Effect.PAUSE
    assert not decision.session or not decision.session.result
    assert fresh(snapshot, now_s)
    assert command is None or command.action is not Action.STOP
    if decision.step is not None:
        assert 0 <= decision.step.index <= rules.top_step
        assert decision.setpoint.current_step == decision.step.index
    if not rules.manual:
        assert command in (None, Command(Action.RESUME))
    elif command == Command(Action.RUN):
        assert shown is not None
        wanted = decision.setpoint
        assert shown.current_step == wanted.current_step
        assert shown.charge_mode is wanted.charge_mode
        assert shown.precharge is wanted.precharge


@settings(max_examples=250)
@given(data=st.data(), control=st.sampled_from(ControlMode), state=states)
def test_whatever_comes_it_decides_soberly(data: st.DataObject, control: ControlMode, state: State) -> None:
    world = beginning(state)
    now_s, memory = world.now_s, world.memory
    rules = RULES[control]
    for _ in range(data.draw(st.integers(1, 6))):
        now_s += data.draw(st.sampled_from([0.0, 0.02, 0.25, 1.0, 4.0, 100.0, 1e6]))
        snapshot = data.draw(nearly_good(now_s, world) if data.draw(st.integers(0, 5)) else snapshots(now_s))
        kept, seen = repr(memory), repr(snapshot)
        decision, after = decide(now_s, snapshot, memory, rules)
        assert (repr(memory), repr(snapshot)) == (kept, seen), "an argument was changed"
        assert repr(decide(now_s, snapshot, memory, rules)) == repr((decision, after)), "not the same twice"
        check(memory, now_s, snapshot, decision, rules)
        memory = after


# --- whatever happens, there is a way back ----------------------------------------------------------------------------

#: A mischief: what is done to the world, by its number, and how long it lasts.
mischief = st.lists(
    st.tuples(st.integers(0, len(SCENES) * 2 + 8), st.sampled_from([1, 3, 8, 40])), min_size=1, max_size=12
)


def do(world: World, number: int) -> None:
    """The beginning or end of a scene, an operator's request, a battery that comes or goes."""
    others: tuple[Callable[[], object], ...] = (
        *(partial(world.ask, request) for request in Request),
        world.leave,
        world.arrive,
        world.boot,
        lambda: setattr(world, "charger_answers", not world.charger_answers),
        lambda: setattr(world, "writes", not world.writes),
    )
    if number < len(SCENES):
        SCENES[number].spoil(world)
    elif number < 2 * len(SCENES):
        SCENES[number - len(SCENES)].heal(world)
    else:
        others[number - 2 * len(SCENES)]()


def all_well(world: World) -> None:
    for scene in SCENES:
        scene.heal(world)
    world.arrive(temperature_c=20.0, soc_pct=50.0, voltage_v=48.0, status=0.0, soh_pct=100.0)
    world.charger_answers = world.writes = True
    world.port_hangs = False
    world.pack_amps = None
    world.leak_a = 0.0
    world.deaf.clear()
    world.shows.clear()


@settings(max_examples=80)
@given(mischief=mischief)
def test_whatever_happened_a_person_gets_it_charging_again(mischief: list[tuple[int, int]]) -> None:
    """No dead end, no livelock: once all causes are gone, a reset and a start make it charge."""
    world = charging()
    for number, ticks in mischief:
        do(world, number)
        for _ in range(ticks):
            world.tick()
    all_well(world)
    world.run(400, dt_s=1.0)  # until every remaining time has run out
    said = world.ask(Request.RESET)
    assert not said or said.startswith("nothing to reset")  # it has continued by itself
    world.tick()
    assert world.ask(Request.START) == ""
    world.until(State.CHARGING, 10)
    for decision in world.decisions:
        locked = any(fault.id == "port_locked" for fault in decision.faults)
        assert (decision.alarm is Alarm.DANGER) is (decision.state is State.UNCONTROLLABLE or locked)
        assert decision.state in ENERGISED or decision.command in (None, STOP)


@pytest.mark.parametrize("state", State)
def test_a_step_at_the_same_time_changes_nothing_but_itself(state: State) -> None:
    """Two readings may arrive at once: a second decision at the same moment is harmless."""
    world = IN[state]()
    first = world.tick()
    decision, _ = decide(world.now_s, world.snapshot(None, ""), world.memory, world.rules)
    assert decision.state is first.state or first.state in (State.IDLE, State.HELD, State.SUSPENDED)
    assert decision.alarm is first.alarm
