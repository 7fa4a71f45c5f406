"""Every row of the fault table: raised in time and not before, stopped in the same decision, ended as the row says."""

import inspect
import re
from dataclasses import replace

import pytest

from orchestrator.core.active import OWN_ADVICE
from orchestrator.core.checks import battery, charge, obedience, ourselves, reports, state_of_charge
from orchestrator.core.faults import FAULTS, RANK, ROW, Check, Clear, FaultRow
from orchestrator.core.latches import BACKOFF_S, CLEAN_S
from orchestrator.core.memory import Memory, with_values
from orchestrator.core.states import ENERGISED
from orchestrator.core.witnesses import measured, pack, paired, standby
from orchestrator.keys import Range, Source
from orchestrator.model import STOP, Cause, Effect, Request, State
from orchestrator.text.catalogue import advise
from tests.core.bays import IN, running_at_the_start
from tests.core.fault_scenes import SCENES, Scene
from tests.core.said import reason_of, say
from tests.core.world import TICK_S, World, bay

# --- the table itself -------------------------------------------------------------------------------------------------

#: How a fault may end, by its effect.
ENDS = {
    Effect.WARN: {Clear.AUTO},
    Effect.LIMIT: {Clear.AUTO},
    Effect.NO_START: {Clear.AUTO, Clear.BACKOFF},
    Effect.PAUSE: {Clear.AUTO},
    Effect.STOP: {Clear.AUTO, Clear.BACKOFF, Clear.OPERATOR},
    Effect.TRIP: {Clear.RESET},
}


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row.id)
def test_a_row_makes_sense(row: FaultRow) -> None:
    assert re.fullmatch(r"[a-z]+(_[a-z]+)*", row.id)
    assert re.fullmatch(r"[BCGP]\d+(, [BCGP]\d+)*", row.source)
    assert row.clear in ENDS[row.effect]
    assert row.where <= set(State)
    assert row.where
    assert row.polls >= 1
    assert row.for_s >= 0
    assert (row.clean_s > 0) >= (row.clear is Clear.AUTO)
    assert row.clean_s == 0 or row.clear in (Clear.AUTO, Clear.RESET)
    assert row.effect is Effect.STOP or not row.departs  # a latch does not leave with the battery
    advice = advise(row.id)
    assert len(advice) > 10
    assert advice[0].islower()
    assert advice[-1] != "."


def test_a_fault_that_is_not_in_the_table_trips_and_is_told_after_all_others() -> None:
    assert (ROW["of a later version"].effect, ROW["of a later version"].clear) == (Effect.TRIP, Clear.RESET)
    assert RANK["of a later version"] > max(RANK.values())


def test_the_rows_are_one_each() -> None:
    assert len(ROW) == len(FAULTS)


def test_every_predicate_is_in_the_table_and_says_where_it_comes_from() -> None:
    modules = (battery, charge, obedience, ourselves, reports, state_of_charge, measured, pack, paired)
    predicates: set[Check] = {
        function
        for module in modules
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if function.__module__ == module.__name__ and not name.startswith("_")
    }
    others = {obedience.did_not_stop, state_of_charge.jump_ends_s, state_of_charge.exchange_ends_s}  # no predicates
    assert {row.check for row in FAULTS} - {standby.current_without_order} == predicates - others
    assert all(function.__doc__ for function in predicates)


def test_what_was_seen_of_an_exchange_counts_for_a_while() -> None:
    seen = with_values(Memory(), exchange=(100.0, Cause("soc_jump")))
    assert state_of_charge.exchange_ends_s(seen) == 100.0 + state_of_charge.EXCHANGE_NEWS_S
    assert state_of_charge.exchange_ends_s(Memory()) is None


def test_every_row_has_a_scene() -> None:
    assert {scene.fault for scene in SCENES} == set(ROW)


# --- its rows, one after another --------------------------------------------------------------------------------------

every_scene = pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)


def spoilt(scene: Scene, world: World | None = None) -> World:
    """The moment before the fault."""
    world = world or scene.begin()
    scene.spoil(world)
    pass_time(world, scene.after_s - TICK_S)
    return world


def pass_time(world: World, seconds: float) -> None:
    """In ticks; most of a long time in whole seconds."""
    ticks = round(seconds / TICK_S)
    whole_s = (ticks - 1) // 4 - 20 if ticks > 100 else 0
    for tick in range(ticks - 4 * whole_s):
        world.tick()
        if tick == 0:
            for _ in range(whole_s):
                world.tick(dt_s=1.0)


def raised(scene: Scene) -> World:
    world = spoilt(scene)
    world.tick()
    assert scene.fault in world.raised, world.decision
    return world


@every_scene
def test_it_is_raised_in_time_with_its_evidence(scene: Scene) -> None:
    world = spoilt(scene)
    assert not world.decisions or scene.fault not in world.raised
    world.tick()
    assert scene.fault in world.raised, world.decision
    text = world.raised[scene.fault]
    for evidence in scene.evidence:
        assert evidence in text
    advices, trips = [advise(one) for one in (scene.fault, *OWN_ADVICE)], ROW[scene.fault].effect is Effect.TRIP
    assert any(text.startswith(f"{one} – ") if trips else text.endswith(f"; {one}") for one in advices)


@every_scene
def test_a_stop_is_ordered_in_the_very_same_step(scene: Scene) -> None:
    world = raised(scene)
    if ROW[scene.fault].effect < Effect.PAUSE:
        assert world.is_in(scene.then, scene.begin().state)
        return
    assert world.decision.command == STOP
    assert world.state not in ENERGISED
    if scene.begin is not running_at_the_start and world.states()[-2] in ENERGISED:
        assert world.is_in(State.STOPPING)
        assert reason_of(world.decision) == say(world.decision.faults[0].cause)


def effect_of(scene: Scene) -> Effect:
    return ROW[scene.fault].effect


@every_scene
def test_it_leads_where_its_effect_says(scene: Scene) -> None:
    world = raised(scene)
    world.until(scene.then, 5.0)
    if scene.then in ENERGISED:
        world.run(5)
        assert world.is_in(scene.then)
        lowest = scene.then is not State.CHARGING or effect_of(scene) >= Effect.LIMIT
        assert (world.decision.step is not None and world.decision.step.index == 0) is lowest
    elif effect_of(scene) >= Effect.NO_START and scene.then not in (State.UNCONTROLLABLE, State.OFFLINE):
        assert world.told[scene.fault] in reason_of(world.decision) or world.decision.faults[0].id != scene.fault


DEBOUNCED = [scene for scene in SCENES if scene.lapse and scene.after_s > TICK_S]


@pytest.mark.parametrize("scene", DEBOUNCED, ids=lambda scene: scene.name)
def test_a_tick_less_is_none(scene: Scene) -> None:
    world = spoilt(scene)
    scene.heal(world)
    world.run(scene.after_s if scene.after_s < 20 else 20)
    assert all(fault.id != scene.fault for decision in world.decisions for fault in decision.faults)


def healed(scene: Scene) -> World:
    """After the fault, at the first tick at which its cause is gone."""
    world = raised(scene)
    world.until(scene.then, 5.0)
    scene.heal(world)
    end_s = world.now_s + 400
    while world.memory.faults[scene.fault].clean_s is None:
        world.tick()
        assert world.now_s < end_s, "the cause does not go away"
    return world


def wait_s(scene: Scene) -> float:
    row = ROW[scene.fault]
    return CLEAN_S + BACKOFF_S[0] if row.clear is Clear.BACKOFF else row.clean_s


def of(*ends: Clear) -> pytest.MarkDecorator:
    scenes = [scene for scene in SCENES if ROW[scene.fault].clear in ends]
    return pytest.mark.parametrize("scene", scenes, ids=lambda scene: scene.name)


@of(Clear.AUTO, Clear.BACKOFF)
def test_it_clears_by_itself_and_not_before(scene: Scene) -> None:
    world = healed(scene)
    clean_s = world.memory.faults[scene.fault].clean_s
    assert clean_s is not None
    while world.now_s < clean_s + wait_s(scene) - TICK_S:
        world.tick()
        assert scene.fault in world.raised
        if ROW[scene.fault].effect >= Effect.NO_START and scene.then not in ENERGISED:
            assert world.state not in ENERGISED
    world.tick()
    assert scene.fault not in world.raised
    if not world.raised:
        world.until(scene.then if scene.then in ENERGISED else State.CHARGING)  # by itself


@of(Clear.OPERATOR)
def test_it_waits_for_a_start(scene: Scene) -> None:
    world = healed(scene)
    world.run(30)
    assert world.is_in(State.HELD)
    assert reason_of(world.decision) == world.told[scene.fault]
    assert world.told[scene.fault].endswith(
        f"; gone since {world.memory.faults[scene.fault].clean_s:.0f} s: orchestrator start bay-1"
    )
    assert world.ask(Request.START) == ""
    assert not world.raised
    world.until(State.CHARGING)


@of(Clear.RESET)
def test_it_waits_for_a_reset_and_then_for_a_start(scene: Scene) -> None:
    world = healed(scene)
    row, text = ROW[scene.fault], scene.fault
    if row.clean_s:
        refused = world.ask(Request.RESET)
        assert f"reset is refused for another {row.clean_s:g} s: " in refused or world.is_in(State.UNCONTROLLABLE)
        assert refused
    world.run(30)
    assert world.is_in(State.TRIPPED)
    assert f"{text}: start is refused before a reset: " in world.ask(Request.START)
    assert world.ask(Request.RESET) == ""
    assert not world.raised
    world.run(30)
    assert world.is_in(State.HELD)
    assert reason_of(world.decision) == "reset by the operator; to go on: orchestrator start bay-1"
    world.values["soc_pct"] = 50.0
    assert world.ask(Request.START) == ""
    while world.tick().state not in ENERGISED:
        assert world.is_in(State.IDLE, State.QUALIFYING), world.decision


LASTING = [scene for scene in SCENES if ROW[scene.fault].clear is Clear.RESET and scene.lapse]


@pytest.mark.parametrize("scene", LASTING, ids=lambda scene: scene.name)
def test_a_reset_is_refused_while_the_cause_is_there(scene: Scene) -> None:
    world = raised(scene)
    if world.memory.faults[scene.fault].clean_s is not None:
        return  # it does not last: the stop has ended it
    assert world.ask(Request.RESET) != ""
    assert scene.fault in world.raised


# --- the same from every state in which current flows -----------------------------------------------------------------

ANYWHERE = [scene for scene in SCENES if scene.anywhere and ROW[scene.fault].effect >= Effect.PAUSE]


@pytest.mark.parametrize("state", sorted(ENERGISED))
@pytest.mark.parametrize("scene", ANYWHERE, ids=lambda scene: scene.name)
def test_it_stops_whatever_is_going_on(scene: Scene, state: State) -> None:
    world = spoilt(scene, IN[state]())
    assert world.is_in(state)
    world.tick()
    assert scene.fault in world.raised
    assert world.is_in(State.STOPPING)
    assert world.decision.command == STOP


def test_only_a_stop_that_is_due_stops() -> None:
    """With nothing wrong for an hour of charging, nothing is reported."""
    world = IN[State.CHARGING]()
    world.amps = 5.0
    world.run(3600, dt_s=1.0)
    assert world.is_in(State.CHARGING)
    assert all(decision.faults == () for decision in world.decisions)


@pytest.mark.parametrize(
    ("limits", "celsius", "place"),
    [
        (Range(0, 45), 46.0, "policies/li-ion-48v.yaml:21"),
        (Range(0, 40), 41.0, "station.yaml:7"),
        (Range(0, 45), -1.0, "policies/li-ion-48v.yaml:21"),
        (Range(5, 45), 4.0, "station.yaml:7"),
    ],
)
def test_a_pause_for_the_temperature_names_the_line_of_the_stricter_limit(
    limits: Range, celsius: float, place: str
) -> None:
    source = Source("station.yaml", {"limits.temperature_c": 7})
    the_bay = replace(bay(), limits=replace(bay().limits, temperature_c=limits), source=source)
    world = World(the_bay, temperature_c=celsius)
    world.until(State.SUSPENDED)
    assert f"({place})" in reason_of(world.decision)
