"""The checker itself: for each of its properties, a core with a bug it must catch, with the counterexample."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf
from typing import Any

import pytest

from orchestrator import model
from orchestrator.core import decide as decide_module
from orchestrator.core import latches, machine, operator, safestop
from orchestrator.core import next_transition as going
from orchestrator.core.facts import Facts
from orchestrator.core.faults import FAULTS, Clear
from orchestrator.core.machine import Trigger
from orchestrator.core.memory import Memory, with_values
from orchestrator.core.next_transition import Next
from orchestrator.core.operator import Heard
from orchestrator.core.persisted import Persisted
from orchestrator.core.resting import resting_place
from orchestrator.core.rules import Rules
from orchestrator.model import Cause, ChargeMode, Effect, Precharge, Request, State
from orchestrator.workbench.prove.endings import ENDINGS
from orchestrator.workbench.prove.exhaustive import here
from orchestrator.workbench.prove.explore import Explorer
from orchestrator.workbench.prove.lasting import reaches, settles
from orchestrator.workbench.prove.properties import PROPERTIES
from tests.proof.exploring import few, rules, small, walk_on

Patch = pytest.MonkeyPatch


def without(*names: str) -> Callable[[Patch], None]:
    """Rows deleted from the fault table."""
    return lambda patch: patch.setattr(latches, "FAULTS", tuple(row for row in FAULTS if row.id not in names))


def only_trips_stop(patch: Patch) -> None:
    energised = going._energised
    patch.setattr(
        going, "_energised", lambda f, faults: energised(f, tuple(x for x in faults if x.effect != Effect.STOP))
    )


def pause_goes_on(patch: Patch) -> None:
    energised = going._energised
    patch.setattr(
        going, "_energised", lambda f, faults: energised(f, tuple(x for x in faults if x.effect > Effect.PAUSE))
    )


def latches_wear_off(patch: Patch) -> None:
    clear_after_s = latches.clear_after_s
    patch.setattr(
        latches, "clear_after_s",
        lambda row, fault: 60.0 if row.clear is Clear.RESET else clear_after_s(row, fault),
    )  # fmt: skip


def trip_is_no_latch(patch: Patch) -> None:
    place = resting_place

    def forgets(f: Facts, faults: Any) -> Any:
        tripped = f.memory.state is State.TRIPPED and f.state_s > 60
        return place(f, tuple(x for x in faults if x.effect is not Effect.TRIP) if tripped else faults)

    patch.setattr(going, "resting_place", forgets)


def stop_is_not_heard(patch: Patch) -> None:
    hear = operator.handle_request

    def deaf(memory: Memory, asked: Request, *more: Any, **named: Any) -> Heard:
        return Heard(memory.operator, memory.faults) if asked is Request.STOP else hear(memory, asked, *more, **named)

    patch.setattr(decide_module, "handle_request", deaf)


def reset_starts(patch: Patch) -> None:
    def reset(memory: Memory, now_s: float) -> Heard:
        return operator._start(with_values(memory, hold=None), now_s, operator.Told("bay-1", at_rest=False, by=None))

    hear = operator.handle_request

    def resets(memory: Memory, asked: Request, now_s: float, *more: Any, **named: Any) -> Heard:
        return reset(memory, now_s) if asked is Request.RESET else hear(memory, asked, now_s, *more, **named)

    patch.setattr(decide_module, "handle_request", resets)


def nobody_qualifies(patch: Patch) -> None:
    fire = machine.fire
    leads = {(State.IDLE, Trigger.QUALIFY): State.CHARGING}
    patch.setattr(decide_module, "fire", lambda state, trigger: leads.get((state, trigger)) or fire(state, trigger))


def any_standby_proves(patch: Patch) -> None:
    patch.setattr(Facts, "stopped", property(lambda f: f.standby))


def standby_need_not_last(patch: Patch) -> None:
    patch.setattr("orchestrator.core.safestop.LASTS_S", 0.0)


def station_limit_is_forgotten(patch: Patch) -> None:
    patch.setattr(Rules, "of", classmethod(lambda cls, bay, of=Rules.of: replace(of(bay), top_step=4)))


def nothing_must_stop(patch: Patch) -> None:
    patch.setattr(decide_module, "must_stop", lambda f, state: False)


def silent_alarm(patch: Patch) -> None:
    patch.setattr(decide_module, "alarm", lambda *_: model.Alarm.NONE)


def a_hold_wears_off(patch: Patch) -> None:
    place = resting_place

    def forgets(f: Facts, faults: Any) -> Any:
        held = f.memory.state is State.HELD and f.state_s > 60
        return place(f, tuple(x for x in faults if x.effect is not Effect.STOP) if held else faults)

    patch.setattr(going, "resting_place", forgets)


def never_gives_up(patch: Patch) -> None:
    patch.setattr(going, "gives_up", lambda f: False)


def nothing_proves(patch: Patch) -> None:
    patch.setattr(Facts, "stopped", property(lambda f: False))


def absent_battery_is_waited_for(patch: Patch) -> None:
    stopping = going._stopping
    patch.setattr(
        going, "_stopping",
        lambda f, faults: Next(None, f.memory.cause) if f.battery_removed and f.state_s < 60 else stopping(f, faults),
    )  # fmt: skip


def silence_is_patient(patch: Patch) -> None:
    gives_up = safestop.gives_up
    patch.setattr(going, "gives_up", lambda f: f.charger.online and gives_up(f))


def strikes_are_forgotten(patch: Patch) -> None:
    patch.setattr(latches, "STRIKES_S", 0.0)


def unwritten_row(patch: Patch) -> None:
    fire = machine.fire

    def without_row(state: State, trigger: Trigger) -> State:
        return fire(State.TRIPPED if (state, trigger) == (State.STOPPING, Trigger.FILL) else state, trigger)

    patch.setattr(decide_module, "fire", without_row)


def never_sure(patch: Patch) -> None:
    patch.setattr(going, "QUALIFY_S", inf)


def no_tolerance(patch: Patch) -> None:
    def differ(f: Facts) -> Cause | None:
        return Cause("volts_disagree") if f.volts != f.pack_v else None

    rows = tuple(replace(row, check=differ) if row.id == "volts_disagree" else row for row in FAULTS)
    patch.setattr(latches, "FAULTS", rows)


def wakes_with_the_wrong_function(patch: Patch) -> None:
    patch.setitem(decide_module.SETPOINTS, State.PRECHARGE_PULSE, (ChargeMode.PRECHARGE, Precharge.OFF))


def nobody_believes_the_bmu(patch: Patch) -> None:
    patch.setattr(Facts, "unordered", property(lambda f: False))


def written_down(change: Callable[[Persisted], Persisted]) -> Callable[[Patch], None]:
    """A restart begins with this."""
    of = Persisted.of
    return lambda patch: patch.setattr(Persisted, "of", lambda memory, now_s: change(of(memory, now_s)))


def counts_anew(persisted: Persisted) -> Persisted:
    session = persisted.session
    return replace(persisted, session=session and replace(session, energised_s=0.0, charged_ah=0.0))


def never_full(patch: Patch) -> None:
    patch.setattr(going, "finished", lambda f: None)


#: The property that must fail → the bug.
BUGS: dict[str, Callable[[Patch], None]] = {
    "fresh": without("stale_reading"),
    "stop at once": only_trips_stop,
    "no current": pause_goes_on,
    "operator": stop_is_not_heard,
    "hold": reset_starts,
    "held": a_hold_wears_off,
    "tripped": trip_is_no_latch,
    "latched": latches_wear_off,
    "qualified": nobody_qualifies,
    "out of control": standby_need_not_last,
    "verified": any_standby_proves,
    "current limit": station_limit_is_forgotten,
    "voltage limit": without("over_voltage"),
    "temperature limit": without("over_temperature", "under_temperature", "hot_trip"),
    "standing stop": nothing_must_stop,
    "alarm": silent_alarm,
    "unordered": nobody_believes_the_bmu,
    "death": written_down(lambda persisted: replace(persisted, running=False)),
    "counters": written_down(counts_anew),
    "in time": never_gives_up,
    "precharge": without("precharge_too_long", "precharge_no_rise"),
    "hours": without("time_limit"),
    "to standby": nothing_proves,
    "to standby, no battery": absent_battery_is_waited_for,
    "named": never_gives_up,
    "named, silent": silence_is_patient,
    "charges": never_sure,
    "charges, as measured": no_tolerance,
    "wakes": wakes_with_the_wrong_function,
    "full": never_full,
    "ends": without("time_limit", "ah_limit"),
    "no livelock": strikes_are_forgotten,
    "no exception": unwritten_row,
}


#: A property is looked at on the way. An ending is looked for from so many places, and where that shows nothing, more.
PLACES = (20, 120, 400)
#: Seen only with a battery that no ending speaks of.
RARE = ("voltage limit", "unordered", "no livelock")


def explored(name: str) -> Iterator[Explorer]:
    """Explorations that may have found it, ever longer ones."""
    on_the_way = name in {rule.name for rule in PROPERTIES} | {"no exception"}
    for most in (None,) if on_the_way else PLACES:
        walk = walk_on((small if name in RARE else few)(rules(current_a=12.0)))
        explorer = Explorer(walk, here(walk))
        if most is None:
            explorer.run(until=name)
        else:
            explorer.run(most=most)
            reaches(explorer, [ending for ending in ENDINGS if ending.name == name])
            settles(explorer) if name == "no livelock" else None
        yield explorer


@pytest.mark.parametrize("name", BUGS)
def test_the_bug_is_caught(name: str, monkeypatch: Patch) -> None:
    BUGS[name](monkeypatch)
    explorer = next((one for one in explored(name) if name in one.found), None)
    assert explorer is not None, "not seen"
    story = str(explorer.found[name])
    assert "t = " in story, "a counterexample has a story"


def test_every_property_has_its_bug() -> None:
    named = {rule.name for rule in PROPERTIES} | {ending.name for ending in ENDINGS} | {"no livelock", "no exception"}
    assert named == set(BUGS)
