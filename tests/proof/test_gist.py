"""What the checker leaves out decides nothing: reached memories with it changed lead to the same results.

So do batteries that differ only for a table of current steps, wherever no step is chosen.
"""

import random
from collections.abc import Callable, Iterator, Mapping

import pytest

from orchestrator.core.memory import FaultMemory, Memory, with_values
from orchestrator.core.operator import STOPPED
from orchestrator.core.states import AT_WORK
from orchestrator.model import Cause, ControlMode, State
from orchestrator.workbench.prove.explore import Place, Walk
from orchestrator.workbench.prove.gist import Gist, gist, outline
from orchestrator.workbench.prove.inputs import StationInputs
from orchestrator.workbench.prove.story import BEGIN_S, TICK_S, Move, Taken
from tests.proof.exploring import POLICIES, rules, small, walk_on

SEED, WALKS, STEPS, TRIES, PLACES = 20260, 40, 30, 12, 30
Change = Callable[[Memory], Memory | None]


def latched(memory: Memory) -> bool:
    return any(fault.latched for fault in memory.faults.values())


def pause_behind_a_hold(memory: Memory) -> Memory | None:
    return with_values(memory, paused=not memory.operator.paused) if memory.operator.hold else None


def hold_behind_a_latch(memory: Memory) -> Memory | None:
    return with_values(memory, hold=None if memory.operator.hold else STOPPED) if latched(memory) else None


def pause_behind_a_latch(memory: Memory) -> Memory | None:
    return with_values(memory, paused=not memory.operator.paused) if latched(memory) else None


def that_it_ran_while_it_stops(memory: Memory) -> Memory | None:
    stops = memory.state in (State.STOPPING, State.UNCONTROLLABLE)
    return with_values(memory, unverified=not memory.stop.unverified) if stops else None


def resume_of_what_runs(memory: Memory) -> Memory | None:
    runs = memory.state is State.CHARGING and memory.stage.ran
    return with_values(memory, resumed=not memory.sequence.resumed) if runs else None


def warning_at_rest(memory: Memory) -> Memory | None:
    """A value no input refers to. A charge that begins with it is distinguished again."""
    if memory.state in AT_WORK or "noisy_line" in memory.faults:
        return None
    noisy = FaultMemory(raised_s=memory.last_s, clean_s=memory.last_s, cause=Cause("noisy_line"))
    return with_values(memory, faults={**memory.faults, "noisy_line": noisy})


CHANGES: Mapping[str, Change] = {
    change.__name__: change
    for change in (
        pause_behind_a_hold, hold_behind_a_latch, pause_behind_a_latch, that_it_ran_while_it_stops,
        resume_of_what_runs, warning_at_rest,
    )
}  # fmt: skip


def places(walk: Walk, inputs: StationInputs) -> Iterator[Place]:
    """The memories reached by random paths that start with several undisturbed seconds."""
    chance, well = random.Random(SEED), Move(TICK_S, "obeys", "healthy")
    moves = list(inputs.moves(State.CHARGING))
    for number in range(WALKS):
        place = Place(Memory(), BEGIN_S)
        for at in range(number + STEPS):
            taken = walk.take(place, well if at < number or chance.random() < 0.5 else chance.choice(moves))
            place = Place(taken.after, taken.now_s)
            yield place


def shown(walk: Walk, taken: Taken) -> tuple[Gist, object]:
    """The outcome of a decision: everything devices and people can observe, except texts."""
    decided = taken.decision
    broken = sorted(name for name, _ in walk.broken(taken))
    return gist(taken.after), (
        decided.command,
        decided.setpoint,
        decided.alarm,
        decided.closed,
        (*broken,),
        taken.error,
    )


@pytest.mark.parametrize("control", ControlMode, ids=lambda mode: mode.name.lower())
@pytest.mark.parametrize("name", CHANGES)
def test_what_is_left_out_decides_nothing(name: str, control: ControlMode) -> None:
    inputs = small(rules(control=control))
    walk, chance = walk_on(inputs), random.Random(SEED)
    moves: list[Move] = list(inputs.moves(State.CHARGING))
    seen: dict[Gist, int] = {}
    for place in places(walk, inputs):
        changed = CHANGES[name](place.memory)
        kind = gist(place.memory)
        if changed is None or seen.get(kind, 0) >= 2:
            continue
        seen[kind] = seen.get(kind, 0) + 1
        assert gist(changed) == kind
        for move in chance.sample(moves, TRIES):
            was, now = (walk.take(Place(one, place.now_s), move) for one in (place.memory, changed))
            assert shown(walk, now) == shown(walk, was), f"{outline(place.memory)}, then {move}"
    assert len(seen) > 1, "no place that it could be tried at"


@pytest.mark.parametrize("policy", POLICIES)
def test_batteries_that_only_a_table_tells_apart_are_others_at_work_only(policy: str) -> None:
    """Each of them leads where one of the tried inputs leads."""
    inputs = StationInputs.of(rules(policy))
    walk, chance = walk_on(inputs), random.Random(SEED)
    left_out = [name for name, battery in inputs.batteries.items() if battery.at_work]
    tried = [name for name in inputs.batteries if name not in left_out]
    kinds: set[Gist] = set()
    for place in places(walk, inputs):
        if place.memory.state in AT_WORK or gist(place.memory) in kinds or len(kinds) == PLACES:
            continue
        kinds.add(gist(place.memory))
        dt_s = chance.choice((TICK_S, *inputs.jumps_s))
        known, found = (
            {shown(walk, walk.take(place, Move(dt_s, "obeys", name))) for name in names} for names in (tried, left_out)
        )
        assert found <= known, f"{outline(place.memory)} after {dt_s} s: {found - known}"
    assert len(kinds) == PLACES
