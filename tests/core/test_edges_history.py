"""What is remembered from one decision to the next, at its edges: the whole part, and the same object if unchanged."""

from typing import Any

import pytest

from orchestrator.core.facts import Facts
from orchestrator.core.history import battery, charger, same_battery, stage
from orchestrator.core.history import session as sessions
from orchestrator.core.memory import BatteryHistory, ChargerHistory, Sequence, Stage
from orchestrator.core.parts import changed
from orchestrator.core.sequence import RESUME, RUN, begins, next_command
from orchestrator.model import (
    Action,
    Cause,
    ChargeMode,
    Command,
    ControlMode,
    CurrentStep,
    Operation,
    Session,
    Setpoint,
    State,
)
from tests.core.edges import NOW_S, PULSE, Edge, ago, raised, witnessed
from tests.core.said import cause

# --- whether a charge has begun ---------------------------------------------------------------------------------------


def began(f: Facts) -> tuple[bool, bool, bool]:
    """Whether it runs or ran, whether the commanded mode was shown, and whether the stage is a new object."""
    after = stage.update(f)
    return after.ran, after.shown, after is not f.memory.stage


NOT_YET: dict[str, Any] = {"ran": False}
TOLD_TO_RUN: dict[str, Any] = {**NOT_YET, "command": RUN}
STANDS = {"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL, "current_a": 0.0}
UNHEARD = {"t_s": ago(9)}


def stopped_in(mode: ChargeMode) -> dict[str, Any]:
    return {**STANDS, "charge_mode": mode}


BEGAN = (
    Edge(began, (True, False, True), NOT_YET),
    Edge(began, (True, False, False)),
    Edge(began, (False, False, False), NOT_YET, State.STOPPING),
    # the BMU has seen its current
    Edge(began, (True, False, True), {**TOLD_TO_RUN, **witnessed()}, charger=STANDS),
    Edge(began, (True, False, True), {**TOLD_TO_RUN, **witnessed(before_a=9.5)}, charger=STANDS),
    Edge(began, (False, False, False), {**TOLD_TO_RUN, **witnessed(before_a=9.51)}, charger=STANDS),
    Edge(began, (False, False, False), TOLD_TO_RUN, charger=STANDS, bmu={"current_a": 1.0}),
    Edge(began, (True, False, True), TOLD_TO_RUN, charger=STANDS, bmu={"current_a": 1.01}),
    Edge(began, (False, False, False), TOLD_TO_RUN, charger=STANDS, bmu={"current_a": None}),
    Edge(began, (True, False, True), TOLD_TO_RUN, charger=UNHEARD),
    Edge(began, (True, False, True), TOLD_TO_RUN, charger=STANDS, control=ControlMode.AUTOMATIC),
    Edge(began, (False, False, False), {**TOLD_TO_RUN, **raised("bmu_frozen")}, charger=STANDS),
    Edge(began, (False, False, False), NOT_YET, charger=STANDS),
    Edge(began, (False, False, False), {**NOT_YET, "command": RESUME}, charger=STANDS),
    # it has shown the commanded mode …
    Edge(began, (False, True, True), NOT_YET, charger=stopped_in(ChargeMode.CHARGE)),
    Edge(began, (False, True, True), NOT_YET, PULSE, charger=stopped_in(ChargeMode.PRECHARGE)),
    Edge(began, (False, False, False), NOT_YET, charger=stopped_in(ChargeMode.BATTERY_SEARCH)),
    Edge(began, (False, False, False), NOT_YET, charger=stopped_in(ChargeMode.CHARGE), control=ControlMode.AUTOMATIC),
    # … and is in standby again
    Edge(began, (True, True, True), {**NOT_YET, "shown": True}, charger=STANDS),
    Edge(began, (False, True, False), {**NOT_YET, "shown": True}, charger=stopped_in(ChargeMode.BATTERY_SEARCH)),
    Edge(began, (False, True, False), {**NOT_YET, "shown": True}, charger=UNHEARD),
    Edge(began, (False, True, False), {**NOT_YET, "shown": True}, charger=STANDS, control=ControlMode.AUTOMATIC),
)  # fmt: skip

# --- a pack that was found full ---------------------------------------------------------------------------------------

FOUND = cause("found full")


def full(f: Facts) -> tuple[Cause | None, float | None, float]:
    """What the session remembers of a full pack a quarter of a second later."""
    after = sessions.update(f, 0.25, None)
    assert after is not None
    return after.full, after.full_pct, after.held_s


def found_full(pct: float | None = 90.0) -> dict[str, Any]:
    return {"session": Session(0.0, full=FOUND, full_pct=pct, held_s=60.0)}


FULL = (
    Edge(full, (FOUND, 90.0, 60.25), found_full(), bmu={"soc_pct": 90.0}),
    Edge(full, (FOUND, 90.0, 60.25), found_full(), bmu={"soc_pct": 87.0}),
    Edge(full, (None, None, 0.0), found_full(), bmu={"soc_pct": 86.9}),
    Edge(full, (FOUND, 90.0, 60.25), found_full(), bmu={"soc_pct": None}),
    Edge(full, (FOUND, None, 60.25), found_full(None), bmu={"soc_pct": 0.0}),
    # an unknown SOC counts as 0 %, and a map may let one be negative
    Edge(full, (FOUND, None, 60.25), found_full(None), bmu={"soc_pct": -3.0}),
    Edge(full, (None, None, 0.0), found_full(None), bmu={"soc_pct": -3.1}),
    Edge(full, (FOUND, 90.0, 60.0), found_full(), State.SUSPENDED, bmu={"soc_pct": 87.0}),
    Edge(full, (None, None, 0.0), found_full(), State.SUSPENDED, bmu={"soc_pct": 86.9}),
    Edge(full, (None, None, 0.0), {"session": Session(0.0)}, bmu={"soc_pct": 99.9}),
)  # fmt: skip

# --- the battery that returns -----------------------------------------------------------------------------------------


def returned_s(f: Facts) -> float | None:
    return battery.update(f).returned_s


def left_as(soc_pct: float | None, pack_v: float | None) -> dict[str, Any]:
    return {"left_s": ago(59.9), "left_as": (soc_pct, pack_v)}


RETURNED = (
    Edge(returned_s, NOW_S, left_as(60.0, 48.0), State.SUSPENDED),
    Edge(returned_s, None, left_as(60.1, 48.0), State.SUSPENDED),
    Edge(returned_s, None, left_as(39.9, 48.0), State.SUSPENDED),
    Edge(returned_s, NOW_S, left_as(None, None), State.SUSPENDED),
    Edge(returned_s, NOW_S, left_as(50.0, 40.0), State.SUSPENDED, bmu={"voltage_v": 42.0}),
    Edge(returned_s, None, left_as(50.0, 40.0), State.SUSPENDED, bmu={"voltage_v": 42.01}),
    Edge(returned_s, None, {**left_as(50.0, 48.0), "left_s": ago(60)}, State.SUSPENDED),
)  # fmt: skip


def watched(f: Facts) -> tuple[bool, object, bool]:
    """Whether it may be another battery, when and how the charger last saw it, and whether that is a new object."""
    after = same_battery.watched(f, f.memory.battery)
    return after.another, after.sight, after is not f.memory.battery


ASLEEP = {"online": False}
WATCHED = (
    Edge(watched, (False, None, False), state=State.FULL),
    Edge(watched, (False, None, True), {"sight": (ago(1), 48.0)}, State.FULL),
    Edge(watched, (False, None, True), {"another": True}, State.FULL),
    Edge(watched, (True, None, False), {"another": True}, State.FULL, bmu_link=ASLEEP),
    Edge(watched, (False, (NOW_S, 48.0), True), state=State.FULL, bmu_link=ASLEEP),
    Edge(watched, (False, (NOW_S, 48.0), True), {"sight": (ago(10), 48.0)}, State.FULL, bmu_link=ASLEEP),
    Edge(watched, (True, None, True), {"sight": (ago(10.01), 48.0)}, State.FULL, bmu_link=ASLEEP),
    Edge(watched, (False, (NOW_S, 42.0), True), {"sight": (ago(1), 40.0)}, State.FULL, bmu_link=ASLEEP,
         charger={"voltage_v": 42.0}),
    Edge(watched, (True, None, True), {"sight": (ago(1), 40.0)}, State.FULL, bmu_link=ASLEEP,
         charger={"voltage_v": 42.01}),
    # without a sight, what its BMU last reported counts
    Edge(watched, (False, (NOW_S, 42.0), True), state=State.FULL, bmu_link=ASLEEP, charger={"voltage_v": 42.0},
         bmu={"voltage_v": 40.0}),
    Edge(watched, (True, None, True), state=State.FULL, bmu_link=ASLEEP, charger={"voltage_v": 42.01},
         bmu={"voltage_v": 40.0}),
    Edge(watched, (False, (NOW_S, 48.0), True), state=State.FULL, bmu_link=ASLEEP, bmu={"voltage_v": None}),
    Edge(watched, (False, (NOW_S, 48.0), True), state=State.FULL, bmu_link=ASLEEP, charger=UNHEARD),
    # at five volts the charger sees a pack
    Edge(watched, (False, (NOW_S, 5.0), True), {"sight": (ago(1), 5.0)}, State.FULL, bmu_link=ASLEEP,
         charger={"voltage_v": 5.0}),
    Edge(watched, (False, (ago(1), 5.0), False), {"sight": (ago(1), 5.0)}, State.FULL, bmu_link=ASLEEP,
         charger={"voltage_v": 4.99}),
)  # fmt: skip


@pytest.mark.parametrize("edge", [*BEGAN, *FULL, *RETURNED, *WATCHED], ids=lambda edge: edge.name)
def test_what_is_remembered_at_its_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


@pytest.mark.parametrize(("serial", "full_pct"), [(None, None), (7, 90.0)])
def test_an_exchanged_battery_is_forgotten(serial: int | None, full_pct: float | None) -> None:
    """With a serial number, it will be known whether it is another."""
    f = Edge(watched, None, {"full_pct": 90.0, "serial": serial, "sight": (ago(1), 48.0)}, State.FULL).facts
    after = same_battery.watched(f, changed(f.memory.battery, exchange=(NOW_S, cause("exchanged"))))
    assert (after.another, after.full_pct, after.sight) == (True, full_pct, None)


@pytest.mark.parametrize(("serial", "known", "full_s"), [(8, 8, None), (0, None, 5.0)])
def test_another_serial_number_is_another_battery(serial: int, known: int | None, full_s: float | None) -> None:
    """No number at all may just not have been told."""
    f = Edge(watched, None, {"full_pct": 90.0, "serial": 7, "full_s": 5.0}, State.FULL, bmu_link={"serial": serial})
    after = same_battery.recognised(f.facts, f.facts.memory.battery)
    assert after == BatteryHistory(another=True, serial=known, full_s=full_s)


def test_the_same_serial_number_is_the_same_battery() -> None:
    f = Edge(watched, None, {"full_pct": 90.0, "serial": 7}, State.FULL, bmu_link={"serial": 7}).facts
    assert same_battery.recognised(f, f.memory.battery) is f.memory.battery


def test_a_charge_that_begins_forgets_that_the_pack_was_full() -> None:
    assert battery.begins(BatteryHistory(full_pct=90.0, full_s=5.0)) == BatteryHistory(full_s=5.0)
    empty = BatteryHistory(full_s=5.0)
    assert battery.begins(empty) is empty


@pytest.mark.parametrize(("all_the_way", "full_s"), [(True, NOW_S), (False, ago(99))])
def test_only_a_charge_all_the_way_counts_as_one(all_the_way: bool, full_s: float) -> None:
    f = Edge(watched, None, {"full_s": ago(99)}).facts
    assert battery.charged_full(f, all_the_way=all_the_way) == BatteryHistory(full_pct=50.0, full_s=full_s)


BEFORE = ChargerHistory(search_s=5.0, idle_s=6.0, wake_s=7.0, counted_t_s=1.0)


def test_a_new_charge_counts_from_its_first_reading() -> None:
    f = Edge(watched, None).facts
    assert charger.begins(f, BEFORE) == ChargerHistory(counted_t_s=NOW_S)
    unheard = Edge(watched, None, charger=UNHEARD).facts
    assert charger.begins(unheard, BEFORE) == ChargerHistory(counted_t_s=None)


def test_a_charge_that_goes_on_searches_again_but_has_been_woken() -> None:
    f = Edge(watched, None, {"session": Session(0.0)}).facts
    assert charger.begins(f, BEFORE) == ChargerHistory(wake_s=7.0, counted_t_s=1.0)


def test_changes_of_the_step_are_counted_in_an_open_charge_only() -> None:
    assert sessions.step_changed(Session(0.0, step_changes=2)) == Session(0.0, step_changes=3)
    assert sessions.step_changed(None) is None


# --- the stage --------------------------------------------------------------------------------------------------------

LOW, HIGH = CurrentStep(0, 2.0, cause("low")), CurrentStep(4, 14.0, cause("high"))


@pytest.mark.parametrize("intends", [True, False])
def test_a_bay_is_ready_whether_or_not_its_turn_has_come(intends: bool) -> None:
    assert stage.is_ready(Stage(qualified_s=3.0), intends=intends) == Stage(
        qualified_s=3.0, ready=True, intends=intends
    )


def test_another_step_begins_the_taper_anew() -> None:
    before = Stage(taper_s=5.0, step=LOW, raise_s=6.0)
    assert stage.chosen(before, HIGH, None, anew=True) == Stage(step=HIGH)
    assert stage.chosen(before, HIGH, 7.0, anew=False) == Stage(taper_s=5.0, step=HIGH, raise_s=7.0)
    assert stage.chosen(before, LOW, 6.0, anew=False) is before


def test_a_voltage_that_is_still_reached_changes_nothing() -> None:
    f, before = Edge(watched, None).facts, Stage(reached_s=5.0)
    assert stage.reaches(f, before, holds=True) is before
    assert stage.reaches(f, before, holds=False) == Stage()
    assert stage.reaches(f, Stage(), holds=True) == Stage(reached_s=NOW_S)


# --- the sequence of commands -----------------------------------------------------------------------------------------

SETPOINT = Setpoint(run=True, current_step=4, charge_mode=ChargeMode.CHARGE)
LIMIT_1 = {"current_step": 0, "operation": Operation.STOPPED, "current_a": 0.0}
LIMIT_5 = Command(Action.SET_LIMIT, 4)


def told(f: Facts) -> tuple[Command | None, Sequence]:
    return next_command(f, SETPOINT)


TOLD = (
    Edge(told, (LIMIT_5, Sequence(LIMIT_5, ago(1.4), 0, resumed=True, resume_s=ago(2))), charger=LIMIT_1, memory={
        "ran": False, "command": LIMIT_5, "command_s": ago(1.4), "resumed": True, "resume_s": ago(2)}),
    Edge(told, (RESUME, Sequence(LIMIT_5, ago(1.5), 1, resumed=False, resume_s=NOW_S)), charger=LIMIT_1, memory={
        "ran": False, "command": LIMIT_5, "command_s": ago(1.5), "resumed": True, "resume_s": ago(2)}),
    Edge(told, (RUN, Sequence(RUN, NOW_S, resumed=True)), {"ran": False, "resumed": True},
         charger=stopped_in(ChargeMode.CHARGE)),
    Edge(told, (Command(Action.SET_MODE, 4), Sequence(Command(Action.SET_MODE, 4), NOW_S, resumed=True)),
         {"ran": False, "resumed": True}, charger=stopped_in(ChargeMode.BATTERY_SEARCH)),
    Edge(told, (None, Sequence()), charger={"charge_mode": ChargeMode.BATTERY_SEARCH}),
)  # fmt: skip


@pytest.mark.parametrize("edge", TOLD, ids=lambda edge: edge.name)
def test_what_the_charger_is_told_next(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_a_sequence_begins_with_a_resume_of_its_own() -> None:
    before = Sequence(command=RUN, command_s=1.0, tries=2, resumed=True, resume_s=3.0)
    assert begins(before, 9.0) == Sequence(command=None, command_s=1.0, tries=2, resumed=False, resume_s=9.0)
