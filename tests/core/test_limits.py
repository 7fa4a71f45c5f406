"""From amperes to the step: every edge of every table, the lowest wins and is named, down at once, up after a hold."""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.config.policy import Band, Policy, Table, Where
from orchestrator.core.decide import PRECHARGE
from orchestrator.core.facts import Facts
from orchestrator.core.limits import choose, present
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.keys import Range, Source
from orchestrator.model import (
    BatteryStatus,
    ChargeMode,
    CurrentStep,
    Measurement,
    Precharge,
    Request,
    Setpoint,
    Snapshot,
    State,
)
from tests.core.bays import POLICY, charging
from tests.core.said import reason_of, say
from tests.core.world import STEPS_A, TICK_S, World, bay

VOLTAGE = Table(
    hysteresis=0.5,
    rows=(
        Band(from_=26.0, to=48.0, max_a=5.0),
        Band(from_=48.0, to=54.0),
        Band(from_=54.0, to=55.2, max_a=8.0),
    ),
)
LINES = {"current.voltage_v": 170, "current.voltage_v.rows[0]": 171, "current.voltage_v.rows[2]": 173}


def policy() -> Policy:
    """The tests' own policy with a table for every quantity."""
    source = Source(POLICY.source.file, {**POLICY.source.lines, **LINES})
    return replace(POLICY, current=replace(POLICY.current, voltage_v=VOLTAGE), source=source)


def with_current(**changes: Any) -> Policy:
    return replace(POLICY, current=replace(POLICY.current, **changes))


#: (what the BMU reports, the step, the rule that bound it: key and text)
EDGES = (
    ({"temperature_c": 0.0}, 0, "temperature_c.rows[0]", "temperature 0.0 °C in 0 … 10 allows 2.0 A"),
    ({"temperature_c": 9.99}, 0, "temperature_c.rows[0]", "temperature 10.0 °C in 0 … 10 allows 2.0 A"),
    ({"temperature_c": 10.0}, 1, "temperature_c.rows[1]", "temperature 10.0 °C in 10 … 15 allows 6.0 A"),
    ({"temperature_c": 15.0}, 4, "", "the highest step, nothing limits it"),
    ({"temperature_c": 44.9}, 4, "", "the highest step, nothing limits it"),
    ({"soc_pct": 0.0}, 4, "", "the highest step, nothing limits it"),
    ({"soc_pct": 89.9}, 4, "", "the highest step, nothing limits it"),
    ({"soc_pct": 90.0}, 2, "soc_pct.rows[1]", "SOC 90 % in 90 … 100 allows 8.0 A"),
    ({"soc_pct": 97.9}, 2, "soc_pct.rows[1]", "SOC 98 % in 90 … 100 allows 8.0 A"),
    ({"soh_pct": 60.0}, 3, "soh_pct.rows[0]", "SOH 60 % in 60 … 80 allows 11.0 A"),
    ({"soh_pct": 79.9}, 3, "soh_pct.rows[0]", "SOH 80 % in 60 … 80 allows 11.0 A"),
    ({"soh_pct": 80.0}, 4, "", "the highest step, nothing limits it"),
    ({"soh_pct": 100.0}, 4, "", "the highest step, nothing limits it"),
    ({"voltage_v": 47.99}, 1, "voltage_v.rows[0]", "pack voltage 47.99 V in 26 … 48 allows 5.0 A"),
    ({"voltage_v": 54.0, "soc_pct": 85.0}, 2, "voltage_v.rows[2]", "pack voltage 54.00 V in 54 … 55.2 allows 8.0 A"),
    ({"voltage_v": 55.2, "soc_pct": 85.0}, 2, "voltage_v.rows[2]", "pack voltage 55.20 V in 54 … 55.2 allows 8.0 A"),
    ({"soc_pct": 90.0, "soh_pct": 60.0}, 2, "soc_pct.rows[1]", "SOC"),
    ({"soc_pct": 79.0, "temperature_c": 12.0}, 1, "temperature_c.rows[1]", "temperature"),
    ({"soc_pct": 80.0, "temperature_c": 12.0}, 0, "where[0]", "temperature 12.0 °C in 0 … 15 and SOC 80 % in 80 … 100"),
    ({"soc_pct": 80.0, "temperature_c": 15.0}, 0, "where[0]", "temperature 15.0 °C in 0 … 15 and SOC 80 %"),
    ({"soc_pct": 80.0, "temperature_c": 15.1}, 4, "", "the highest step"),
    ({"soh_pct": 60.0, "voltage_v": 47.0}, 1, "voltage_v.rows[0]", "pack voltage"),
)


@pytest.mark.parametrize(("values", "index", "key", "words"), EDGES)
def test_the_lowest_wins_and_has_a_name(values: dict[str, float], index: int, key: str, words: str) -> None:
    the_policy = policy()
    world = World(bay(the_policy), **values).charging()
    step = world.decision.step
    assert step is not None
    place = the_policy.source.at("current." + key) if key else ""
    assert (step.index, step.current_a) == (index, STEPS_A[index])
    assert (step.key, step.place) == (f"current.{key}" if key else "", place)
    assert say(step.rule).startswith(words)
    assert say(step.rule).endswith(f", {place}") or not key
    assert world.charger.limit == index
    assert world.decision.setpoint == Setpoint(True, index, ChargeMode.CHARGE, Precharge.OFF)
    assert world.decision.answer is None
    assert reason_of(world.decision) == f"step {index + 1} ({STEPS_A[index]:.1f} A): {say(step.rule)}"


def test_amperes_are_what_flows_into_the_pack() -> None:
    """Never more: the step's worst case counts, and a C value does not lose a step to the last digit of a product."""
    pack = replace(POLICY.pack, capacity_ah=20.0)
    rows = (Band(from_=0, to=45, max_c=0.7),)
    seven_tenths = replace(with_current(temperature_c=Table(rows=rows)), pack=pack)
    assert index(World(bay(seven_tenths)).charging()) == 4
    the_bay = bay(seven_tenths)
    tolerant = replace(the_bay, charger=replace(the_bay.charger, tolerance_pct=1.0))
    world = World(tolerant).charging()
    assert world.decision.step is not None
    assert world.decision.step.label == "step 4 (11.0 A)"
    assert say(world.decision.step.rule) == f"the pack bears 14.0 A, {POLICY.source.at('pack.current_a')}"


def test_the_share_that_a_row_names_is_said() -> None:
    pack = replace(POLICY.pack, capacity_ah=20.0)
    rows = (Band(from_=0, to=45, max_c=0.3),)
    world = World(bay(replace(with_current(temperature_c=Table(rows=rows)), pack=pack))).charging()
    assert world.decision.step is not None
    assert say(world.decision.step.rule).startswith("temperature 20.0 °C in 0 … 45 allows 6.0 A (0.3 C), ")


def test_a_table_that_is_not_there_hides_no_other() -> None:
    without = replace(policy(), current=replace(policy().current, soh_pct=None))
    assert index(World(bay(without), voltage_v=47.0).charging()) == 1


def test_the_first_of_two_equal_limits_is_named() -> None:
    rows = (Band(from_=0, to=45, max_a=8.0),)
    world = World(bay(with_current(temperature_c=Table(rows=rows))), soc_pct=95.0).charging()
    assert world.decision.step is not None
    assert world.decision.step.key == "current.temperature_c.rows[0]"


def test_two_tables_on_one_line_are_told_apart() -> None:
    """What binds is identified by its key, not its place; otherwise one rule's sentence would stay for the other."""
    line = {f"current.{name}.rows[0]": 7 for name in ("temperature_c", "soc_pct")}
    table, other = Table(rows=(Band(from_=0, to=45, max_a=8.0),)), Table(rows=(Band(from_=0, to=100, max_a=9.0),))
    one_line = replace(with_current(temperature_c=table, soc_pct=other), source=Source("p.yaml", line))
    world = World(bay(one_line)).charging()
    assert world.decision.step is not None
    assert say(world.decision.step.rule) == "temperature 20.0 °C in 0 … 45 allows 8.0 A, p.yaml:7"
    less = Table(rows=(Band(from_=0, to=100, max_a=8.0),))
    more = Table(rows=(Band(from_=0, to=45, max_a=9.0),))
    swapped = replace(one_line, current=replace(one_line.current, temperature_c=more, soc_pct=less))
    world.rules = Rules.of(bay(swapped))
    world.tick()
    assert (world.decision.step.key, world.decision.step.place) == ("current.soc_pct.rows[0]", "p.yaml:7")
    assert say(world.decision.step.rule) == "SOC 50 % in 0 … 100 allows 8.0 A, p.yaml:7"


@pytest.mark.parametrize(("current_a", "index"), [(15.0, 4), (14.0, 4), (13.99, 3), (11.0, 3), (2.0, 0)])
def test_no_step_is_above_the_stations_limit(current_a: float, index: int) -> None:
    the_bay = replace(bay(current_a=current_a), source=Source("depot.yaml", {"limits.current_a": 12}))
    world = World(the_bay).charging()
    assert world.decision.step is not None
    assert world.decision.step.index == index
    if index < 4:
        assert say(world.decision.step.rule) == "the station's current limit, depot.yaml:12"


def test_what_no_row_covers_gets_the_lowest_step() -> None:
    """The station may allow more than the policy's tables cover."""
    wide = replace(POLICY, pack=replace(POLICY.pack, temperature_c=Range(-10, 50)))
    the_bay = replace(bay(wide), limits=replace(bay().limits, temperature_c=Range(-10, 50)))
    for celsius in (-0.1, 45.1):
        world = World(the_bay, temperature_c=celsius).charging()
        step = world.decision.step
        assert step is not None
        at = wide.source.at("current.temperature_c")
        assert (step.index, say(step.rule)) == (0, f"temperature {celsius:.1f} °C outside of its table, {at}")
    world = World(the_bay, temperature_c=45.0).charging()
    assert index(world) == 4  # the last row includes its end


# --- down at once, up after a hold ------------------------------------------------------------------------------------


def index(world: World) -> int:
    assert world.decision.step is not None
    return world.decision.step.index


def test_down_in_the_same_step_up_after_the_hold() -> None:
    world = World(temperature_c=17.0).charging()
    assert index(world) == 4
    world.values["temperature_c"] = 14.0
    world.tick()
    assert index(world) == 1
    world.run(100)
    world.values["temperature_c"] = 16.0
    world.run(60)
    assert index(world) == 1
    at = POLICY.source.at("current.raise_after_s")
    assert reason_of(world.decision).endswith(f"; a higher step is allowed, and taken after 60 s ({at})")
    world.tick()
    assert index(world) == 4
    world.tick()
    assert "a higher step is allowed" not in reason_of(world.decision)
    assert world.decision.session is not None
    assert world.decision.session.step_changes == 2


def test_a_dip_begins_the_hold_anew() -> None:
    world = World(temperature_c=14.0).charging()
    for _ in range(5):
        world.values["temperature_c"] = 16.5
        world.run(59)
        world.values["temperature_c"] = 14.5
        world.tick()
    assert index(world) == 1
    world.values["temperature_c"] = 16.5
    world.run(60)
    assert index(world) == 1
    world.tick()
    assert index(world) == 4


# --- nothing chatters at a bound --------------------------------------------------------------------------------------


def test_more_only_when_the_value_is_well_inside_the_next_row() -> None:
    world = World(temperature_c=14.9).charging()
    for celsius in (15.0, 15.9, 14.9, 15.9):
        world.values["temperature_c"] = celsius
        world.run(100)
        assert index(world) == 1
    world.values["temperature_c"] = 16.0
    world.run(61)
    assert index(world) == 4
    world.values["temperature_c"] = 15.1
    world.run(61)
    assert index(world) == 4, "it was left for good: less than its bound takes it back"
    world.values["temperature_c"] = 14.9
    world.tick()
    assert index(world) == 1


def test_a_row_that_holds_on_is_said_as_such() -> None:
    world = World(temperature_c=14.9).charging()
    world.values["soh_pct"] = 60.0
    world.values["temperature_c"] = 15.4
    world.tick()
    world.ask(Request.PAUSE)
    world.until(State.SUSPENDED)
    world.ask(Request.START)
    world.charging()
    assert world.decision.step is not None
    assert say(world.decision.step.rule).startswith("temperature 15.4 °C not yet 1 beyond 10 … 15 allows 6.0 A")


def test_another_battery_begins_without_the_rows_of_the_last() -> None:
    world = World(temperature_c=14.9).charging()
    world.leave()
    world.until(State.IDLE)
    world.arrive(temperature_c=15.4)
    world.charging()
    assert index(world) == 4


def test_without_a_word_it_is_twice_what_the_sensor_resolves() -> None:
    table = replace(POLICY.current.temperature_c, hysteresis=None)
    world = World(bay(with_current(temperature_c=table)), temperature_c=14.9).charging()
    world.values["temperature_c"] = 15.1
    world.run(61)
    assert index(world) == 1
    world.values["temperature_c"] = 15.2
    world.run(61)
    assert index(world) == 4


def test_a_rule_on_two_quantities_holds_on_likewise() -> None:
    world = World(temperature_c=14.9, soc_pct=80.0).charging()
    assert index(world) == 0
    world.values["temperature_c"] = 16.0
    world.run(61)
    assert index(world) == 0
    world.values["temperature_c"] = 16.1
    world.run(61)
    assert index(world) == 4


# --- a pause, and a charger whose lowest step is too high -------------------------------------------------------------


def paused_when_hot() -> Policy:
    rows = (Band(from_=0, to=40), Band(from_=40, to=45, max_a=0.0))
    return with_current(temperature_c=Table(hysteresis=2.0, rows=rows))


def test_no_amperes_are_a_pause_until_well_inside() -> None:
    world = World(bay(paused_when_hot()), temperature_c=39.0).charging()
    world.values["temperature_c"] = 40.0
    world.tick()
    assert world.is_in(State.STOPPING)
    at = POLICY.source.at("current.temperature_c.rows[1]")
    assert world.raised["current_paused"].startswith(f"temperature 40.0 °C in 40 … 45 allows no current, {at}")
    world.until(State.SUSPENDED, 10)
    world.values["temperature_c"] = 38.5
    world.run(60)
    assert world.is_in(State.SUSPENDED)
    world.values["temperature_c"] = 38.0
    world.until(State.CHARGING, 30)


def test_a_charger_that_cannot_give_so_little_begins_no_charge() -> None:
    rows = (Band(from_=0, to=45, max_a=1.9),)
    world = World(bay(with_current(temperature_c=Table(rows=rows))))
    world.until(State.SUSPENDED)
    assert "no_step_allowed" in world.raised
    assert reason_of(world.decision).startswith("temperature 20.0 °C in 0 … 45 allows 1.9 A")
    assert "the lowest step of this charger is 2 A" in reason_of(world.decision)
    world.run(300)
    assert State.CHARGING not in world.states()


def test_and_pauses_one_that_runs() -> None:
    rule = Where(temperature_c=Range(30, 45), soc_pct=Range(0, 100), max_a=1.0)
    world = World(bay(with_current(where=(rule,)))).charging()
    world.values["temperature_c"] = 30.0
    world.tick()
    assert world.is_in(State.STOPPING)
    assert "temperature 30.0 °C in 30 … 45 and SOC 50 % in 0 … 100 allows 1.0 A" in world.raised["current_paused"]


def test_precharge_is_refused_where_the_lowest_step_is_too_much() -> None:
    assert POLICY.precharge is not None
    gentle = replace(POLICY, precharge=replace(POLICY.precharge, max_a=1.9))
    world = World(bay(gentle), voltage_v=33.0)
    world.until(State.SUSPENDED)
    assert "needs precharge with at most 1.9 A" in world.raised["precharge_too_strong"]
    assert index(World(bay(gentle)).charging()) == 4, "a pack that needs none is charged"


# --- sentences --------------------------------------------------------------------------------------------------------


def test_the_sentence_stays_while_its_line_binds() -> None:
    """Otherwise status and journal would change with every tenth of a degree."""
    world = World(temperature_c=5.0).charging()
    step = world.decision.step
    world.values["temperature_c"] = 5.7
    world.run(1)
    assert world.decision.step is step


def test_the_sentence_changes_with_the_line() -> None:
    rows = (Band(from_=0, to=5, max_a=2.0), Band(from_=5, to=10, max_a=2.0), Band(from_=10, to=45))
    world = World(bay(with_current(temperature_c=Table(rows=rows))), temperature_c=4.0).charging()
    world.values["temperature_c"] = 6.0
    world.tick()
    assert world.decision.step is not None
    assert say(world.decision.step.rule).startswith("temperature 6.0 °C in 5 … 10")


def test_a_new_charge_needs_no_hold() -> None:
    world = World(temperature_c=9.0).charging()
    world.ask(Request.PAUSE)
    world.until(State.SUSPENDED)
    world.values["temperature_c"] = 13.0
    world.run(3)
    world.values["temperature_c"] = 17.0
    world.ask(Request.START)
    world.charging()
    assert index(world) == 4


def test_what_is_not_known_is_the_lowest_step() -> None:
    """The fault table ends such a charge in the same decision; the limit does not rely on that."""
    world = charging()
    step, raise_s = choose(Facts.of(world.now_s, Snapshot(), world.memory, world.rules), None)
    at = POLICY.source.at("current.temperature_c")
    assert (step.index, say(step.rule), raise_s) == (0, f"temperature unknown, {at}", None)


def test_a_rule_about_what_is_not_known_holds_and_says_so() -> None:
    """It is unknown whether the pack is inside, so it counts as inside."""
    rule = Where(voltage_v=Range(53, 55.2), temperature_c=Range(0, 45), max_a=0.0)
    world = World(bay(with_current(where=(rule,)))).charging()
    assert index(world) == 4, "at 48 V the rule says nothing"
    world.values["voltage_v"] = None
    world.run(2)
    text = world.raised["current_paused"]
    assert text.startswith("temperature 20.0 °C in 0 … 45 and pack voltage unknown allows no current"), text


# --- faults that limit ------------------------------------------------------------------------------------------------


def test_a_fault_that_limits_means_the_lowest_step_and_is_named() -> None:
    world = charging()
    world.values["status"] = float(1 << BatteryStatus.LOW_TEMPERATURE)
    world.tick()
    assert world.decision.step is not None
    assert world.decision.step.index == 0
    assert say(world.decision.step.rule) == "the fault status_limit"
    assert (world.decision.step.key, world.decision.step.place) == ("fault status_limit", "")
    world.tick()
    assert reason_of(world.decision) == f"step 1 (2.0 A): the fault status_limit; {world.raised['status_limit']}"
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
        assert world.decision.step == CurrentStep(0, STEPS_A[0], PRECHARGE)


# --- rows that keep coming back ---------------------------------------------------------------------------------------


def there_and_back(world: World) -> list[int]:
    """The pack's voltage falls back by more than its table's hysteresis whenever the current does."""
    found = []
    for volts in (54.0, 53.0) * 4:
        world.values["voltage_v"] = volts
        world.run(62)
        found.append(index(world))
    return found


def test_a_row_that_comes_back_again_and_again_stays_for_the_rest_of_the_charge() -> None:
    world = World(bay(policy()), soc_pct=85.0, voltage_v=53.0).charging()
    assert there_and_back(world) == [2, 4, 2, 4, 2, 2, 2, 2]
    assert world.decision.step is not None
    assert world.decision.step.key == "current.voltage_v.rows[2]"
    world.ask(Request.STOP)
    world.until(State.HELD)
    world.ask(Request.START)
    world.charging()
    world.run(62)
    assert index(world) == 4, "another charge begins anew"


def test_a_row_that_stays_says_that_it_came_back_too_often() -> None:
    """The value that people see is far from the row, so the sentence says why the row still counts."""
    world = World(bay(policy()), soc_pct=85.0, voltage_v=53.0).charging()
    there_and_back(world)
    world.ask(Request.PAUSE)
    world.until(State.SUSPENDED)
    world.ask(Request.START)
    world.charging()
    assert world.decision.step is not None
    rule = say(world.decision.step.rule)
    assert rule.startswith("pack voltage 53.00 V beyond 54 … 55.2, to which it came back too often in this charge")
    assert "allows 8.0 A" in rule


def test_a_pause_may_come_back_as_often_as_it_must() -> None:
    world = World(bay(paused_when_hot()), temperature_c=38.0).charging()
    for _ in range(5):
        for celsius in (39.0, 40.0, 39.0, 38.0):
            world.values["temperature_c"] = celsius
            world.run(3)
        world.until(State.CHARGING, 60)


def test_a_row_is_told_with_the_present_value_whatever_it_was_chosen_by() -> None:
    world, nearly_full = charging(), World(soc_pct=92.0).charging()
    key = next(bound.key for bounds in world.rules.table_bounds for bound in bounds if "soc_pct" in bound.key)
    for one, soc_pct, words in ((world, 55.0, "SOC 55 % in"), (nearly_full, 92.0, "SOC 92 % has left")):
        snapshot = one.snapshot(None, "")
        battery = replace(snapshot.battery, soc_pct=Measurement(soc_pct, one.now_s))
        cause = present(key, replace(snapshot, battery=battery), one.memory, one.rules)
        assert cause is not None
        assert cause.key == key
        assert words in say(cause)
    cold = World(
        bay(with_current(where=(Where(temperature_c=Range(0, 45), soc_pct=Range(0, 90), max_a=8.0),)))
    ).charging()
    rule = present("current.where[0]", cold.snapshot(None, ""), cold.memory, cold.rules)
    assert rule is not None and rule.key == "current.where[0]"
    assert present("limits.current_a", world.snapshot(None, ""), world.memory, world.rules) is None
    assert present(key, world.snapshot(None, ""), Memory(), world.rules) is None  # nothing was decided yet
