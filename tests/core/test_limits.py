"""The current-limit step: every edge of every table, the lowest wins and is named, down at once, up after a hold."""

from dataclasses import replace

import pytest

from orchestrator.config.policy import Band, Policy
from orchestrator.core.facts import Facts
from orchestrator.core.limits import choose
from orchestrator.core.step import PRECHARGE
from orchestrator.keys import Range, Source
from orchestrator.model import BatteryStatus, ChargeMode, Precharge, Request, Setpoint, Snapshot, State, Step
from tests.core.bays import POLICY, charging
from tests.core.said import reason_of, say
from tests.core.world import STEPS_A, TICK_S, World, bay

VOLTAGE = (
    Band(from_=26.0, to=48.0, step=1),
    Band(from_=48.0, to=54.0, step=4),
    Band(from_=54.0, to=55.2, step=2),
)
LINES = {"current.voltage_v": 70, "current.voltage_v[0]": 71, "current.voltage_v[2]": 73}


def policy() -> Policy:
    """li-ion-48v with a table for every quantity."""
    source = Source(POLICY.source.file, {**POLICY.source.lines, **LINES})
    return replace(POLICY, current=replace(POLICY.current, voltage_v=VOLTAGE), source=source)


#: (what the BMU says, the step, the rule that bound it: path and text)
EDGES = (
    ({"temperature_c": 0.0}, 0, "temperature_c[0]", "temperature 0.0 °C in 0 … 10"),
    ({"temperature_c": 9.99}, 0, "temperature_c[0]", "temperature 10.0 °C in 0 … 10"),
    ({"temperature_c": 10.0}, 4, "", "the highest step, nothing limits it"),
    ({"temperature_c": 44.9}, 4, "", "the highest step, nothing limits it"),
    ({"soc_pct": 0.0}, 4, "", "the highest step, nothing limits it"),
    ({"soc_pct": 89.9}, 4, "", "the highest step, nothing limits it"),
    ({"soc_pct": 90.0}, 2, "soc_pct[1]", "SOC 90 % in 90 … 100"),
    ({"soc_pct": 97.9}, 2, "soc_pct[1]", "SOC 98 % in 90 … 100"),
    ({"soh_pct": 60.0}, 3, "soh_pct[0]", "SOH 60 % in 60 … 80"),
    ({"soh_pct": 79.9}, 3, "soh_pct[0]", "SOH 80 % in 60 … 80"),
    ({"soh_pct": 80.0}, 4, "", "the highest step, nothing limits it"),
    ({"soh_pct": 100.0}, 4, "", "the highest step, nothing limits it"),
    ({"voltage_v": 47.99}, 1, "voltage_v[0]", "pack voltage 47.99 V in 26 … 48"),
    ({"voltage_v": 54.0, "soc_pct": 85.0}, 2, "voltage_v[2]", "pack voltage 54.00 V in 54 … 55.2"),
    ({"voltage_v": 55.2, "soc_pct": 85.0}, 2, "voltage_v[2]", "pack voltage 55.20 V in 54 … 55.2"),
    ({"soc_pct": 90.0, "soh_pct": 60.0}, 2, "soc_pct[1]", "SOC"),
    ({"soc_pct": 90.0, "temperature_c": 5.0}, 0, "temperature_c[0]", "temperature"),
    ({"soh_pct": 60.0, "voltage_v": 47.0}, 1, "voltage_v[0]", "pack voltage"),
)


@pytest.mark.parametrize(("values", "index", "path", "words"), EDGES, ids=str)
def test_the_lowest_wins_and_has_a_name(values: dict[str, float], index: int, path: str, words: str) -> None:
    the_policy = policy()
    world = World(bay(the_policy), **values).charging()
    step = world.decision.step
    assert step is not None
    assert (step.index, step.current_a) == (index, STEPS_A[index])
    rule = say(step.rule)
    assert rule.startswith(words)
    assert rule.endswith(f", {the_policy.source.at('current.' + path)}" if path else words)
    assert world.charger.limit == index
    assert world.decision.setpoint == Setpoint(True, index, ChargeMode.CHARGE, Precharge.OFF)
    assert world.decision.answer is None
    assert reason_of(world.decision) == f"step {index} ({STEPS_A[index]:.1f} A): {rule}"


def test_a_table_that_is_not_there_hides_no_other() -> None:
    without = replace(policy(), current=replace(policy().current, soh_pct=None))
    assert index(World(bay(without), voltage_v=47.0).charging()) == 1


def test_the_first_of_two_equal_limits_is_named() -> None:
    world = World(bay(replace(policy(), current=replace(policy().current, temperature_c=(
        Band(from_=0, to=45, step=2),)))), soc_pct=95.0).charging()  # fmt: skip
    assert world.decision.step is not None
    assert say(world.decision.step.rule).startswith("temperature")


@pytest.mark.parametrize(("current_a", "index"), [(15.0, 4), (14.0, 4), (13.99, 3), (11.0, 3), (2.0, 0), (1.0, 0)])
def test_no_step_is_above_the_stations_limit(current_a: float, index: int) -> None:
    the_bay = replace(bay(current_a=current_a), source=Source("depot.yaml", {"limits.current_a": 12}))
    world = World(the_bay).charging()
    assert world.decision.step is not None
    assert world.decision.step.index == index
    if index < 4:
        assert say(world.decision.step.rule) == "the station's current limit, depot.yaml:12"


def test_a_table_is_not_left_without_a_limit() -> None:
    """The station may allow more than the policy's tables cover; what they do not cover is the lowest step."""
    wide = replace(POLICY, pack=replace(POLICY.pack, temperature_c=Range(-10, 50)))
    the_bay = replace(bay(wide), limits=replace(bay().limits, temperature_c=Range(-10, 50)))
    for celsius in (-0.1, 45.1):
        world = World(the_bay, temperature_c=celsius).charging()
        step = world.decision.step
        assert step is not None
        assert step.index == 0
        at = wide.source.at("current.temperature_c")
        assert say(step.rule) == f"temperature {celsius:.1f} °C outside of its table, {at}"
    world = World(the_bay, temperature_c=45.0).charging()
    assert world.decision.step is not None
    assert world.decision.step.index == 4  # the last row's end is included


# --- down at once, up after a hold ------------------------------------------------------------------------------------


def index(world: World) -> int:
    assert world.decision.step is not None
    return world.decision.step.index


def test_down_in_the_same_step_up_after_the_hold() -> None:
    world = World(temperature_c=12.0).charging()
    assert index(world) == 4
    world.values["temperature_c"] = 9.0
    world.tick()
    assert index(world) == 0
    world.run(100)
    world.values["temperature_c"] = 11.0
    world.run(60)
    assert index(world) == 0
    at = POLICY.source.at("current.raise_after_s")
    assert reason_of(world.decision).endswith(f"; a higher step is allowed, and taken after 60 s ({at})")
    world.tick()
    assert index(world) == 4
    world.tick()
    assert "a higher step is allowed" not in reason_of(world.decision)
    assert world.decision.session is not None
    assert world.decision.session.step_changes == 2


def test_a_dip_begins_the_hold_anew() -> None:
    world = World(temperature_c=9.0).charging()
    for _ in range(5):
        world.values["temperature_c"] = 10.5
        world.run(59)
        world.values["temperature_c"] = 9.5
        world.tick()
    assert index(world) == 0
    world.values["temperature_c"] = 10.5
    world.run(60)
    assert index(world) == 0
    world.tick()
    assert index(world) == 4


def test_the_sentence_stays_while_its_line_binds() -> None:
    """Else status and journal would say something new with every tenth of a degree."""
    world = World(temperature_c=5.0).charging()
    step = world.decision.step
    world.values["temperature_c"] = 5.7
    world.run(1)
    assert world.decision.step is step


def test_the_sentence_changes_with_the_line() -> None:
    the_policy = replace(POLICY, current=replace(POLICY.current, temperature_c=(
        Band(from_=0, to=5, step=0), Band(from_=5, to=10, step=0), Band(from_=10, to=45, step=4))))  # fmt: skip
    world = World(bay(the_policy), temperature_c=4.0).charging()
    world.values["temperature_c"] = 6.0
    world.tick()
    assert world.decision.step is not None
    assert say(world.decision.step.rule).startswith("temperature 6.0 °C in 5 … 10")


def test_a_new_charge_needs_no_hold() -> None:
    world = World(temperature_c=9.0).charging()
    world.ask(Request.PAUSE)
    world.until(State.SUSPENDED)
    world.values["temperature_c"] = 13.0
    world.ask(Request.START)
    world.charging()
    assert index(world) == 4


def test_what_is_not_known_is_the_lowest_step() -> None:
    """The fault table ends such a charge in the same step; the limit does not rely on that."""
    world = charging()
    step, raise_s = choose(Facts(world.now_s, Snapshot(), world.memory, world.rules), None)
    at = POLICY.source.at("current.temperature_c")
    assert (step.index, say(step.rule), raise_s) == (0, f"temperature unknown, {at}", None)


# --- faults that limit ------------------------------------------------------------------------------------------------


def test_a_fault_that_limits_means_the_lowest_step_and_is_named() -> None:
    world = charging()
    world.values["status"] = float(1 << BatteryStatus.LOW_TEMPERATURE)
    world.tick()
    assert world.decision.step is not None
    assert world.decision.step.index == 0
    assert say(world.decision.step.rule) == "the fault status_limit"
    world.tick()
    assert reason_of(world.decision) == f"step 0 (2.0 A): the fault status_limit; {world.raised['status_limit']}"
    world.values["status"] = 0.0
    world.run(10 + 60)
    assert index(world) == 0
    world.run(2 * TICK_S)
    assert index(world) == 4


def test_a_warning_does_not_limit() -> None:
    world = charging()
    world.charger_link = replace(world.charger_link, bad_pct=9.0)
    world.run(1)
    assert set(world.raised) == {"noisy_line"}
    assert index(world) == 4
    assert "noisy" not in reason_of(world.decision)


def test_precharge_is_always_on_the_lowest_step() -> None:
    for volts, state in ((33.0, State.PRECHARGE_PULSE), (36.0, State.PRECHARGE_CONTINUOUS)):
        world = World(voltage_v=volts).charging(state)
        assert index(world) == 0
        assert world.charger.limit == 0
        assert world.decision.step == Step(0, STEPS_A[0], PRECHARGE)
