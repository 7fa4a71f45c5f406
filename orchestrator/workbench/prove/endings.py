"""What must become of a bay when nothing happens any more: that it comes to rest, stops, charges, and is charged full.

Each memory that was explored is left alone in lasting surroundings, with small steps of time after every change of
state or order, and ever larger ones while there is none. To change for ever without news from outside is a livelock.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import inf

from orchestrator.core.faults import ROW, Clear
from orchestrator.core.memory import Memory
from orchestrator.core.states import AT_REST, ENERGISED
from orchestrator.model import STOP, Request, State
from orchestrator.workbench.prove.explore import Explorer, Node, Place, Walk
from orchestrator.workbench.prove.gist import details
from orchestrator.workbench.prove.story import TICK_S, Move, Taken

#: While nothing changes: so many steps of each length. Beyond the last one all timers have run out.
LADDER = ((16, TICK_S), (10, 1.0), (12, 5.0), (12, 30.0), (10, 300.0), (4, 3600.0), (12, 6 * 3600.0))
#: More changes of state than this without news: the longest orderly story is three backoffs and a latch.
PATIENCE = 60
#: … of which a story tells so many steps.
SHOWN = 40
#: So many surroundings are looked at in one job: its places are many, and go to another process with it.
TOGETHER = 8
#: What backoffs, hysteresis and the qualification take together, at most.
RECOVERY_S = 600.0
#: A taper and the hold after it take no longer, in what ships.
HELD_S = 3600.0
#: In this time a pack comes from any temperature to any other without looking like a broken sensor.
SLOWLY_S = 30.0
#: Faults that a charge brings with it have shown by then.
STEADY_S = 10.0


@dataclass(frozen=True, slots=True)
class Ending:
    """What must become of every memory that it is `asked_of`, when surroundings last after the operator's `request`."""

    name: str
    about: str
    charger: str  #: the names of classes of inputs
    battery: str
    within_s: float
    reached: Callable[[Taken], bool]
    request: Request | None = None
    first_s: float = TICK_S  #: after so long the surroundings begin
    asked_of: Callable[[Memory], bool] = lambda _: True


def _stands_by(taken: Taken) -> bool:
    return taken.after.state in AT_REST and taken.decision.command is None


def _uncontrollable(taken: Taken) -> bool:
    return taken.after.state is State.UNCONTROLLABLE


def _called(taken: Taken) -> bool:
    """Where people are told, and the stop is repeated for as long as it is not proved."""
    named = taken.after.state in (State.UNCONTROLLABLE, State.OFFLINE, State.TRIPPED)
    return named and taken.decision.command == STOP


def _charges(taken: Taken) -> bool:
    return _runs(taken, State.CHARGING)


def _wakes(taken: Taken) -> bool:
    return _runs(taken, State.PRECHARGE_PULSE)


def _runs(taken: Taken, state: State) -> bool:
    """Long enough for any fault to show."""
    since_s = taken.after.since_s or taken.now_s
    runs = taken.after.state is state and taken.after.stage.ran and taken.now_s - since_s > STEADY_S
    return runs or _exchanged(taken)


def _exchanged(taken: Taken) -> bool:
    """The change of surroundings looks like another battery, after which a person must act."""
    return "battery_exchanged" in taken.after.faults


def _full(taken: Taken) -> bool:
    """A pack cannot come from any temperature to any other in the moment in which it gets full: that is no ending."""
    return taken.after.state is State.FULL or "temperature_invalid" in taken.after.faults


def _ended(taken: Taken) -> bool:
    return taken.after.state not in ENERGISED


def _free(memory: Memory) -> bool:
    """No person must act before the bay charges (again), and it is not charging."""
    waits = any(fault.latched or ROW[name].clear is Clear.OPERATOR for name, fault in memory.faults.items())
    asked = memory.operator.hold or memory.operator.paused
    return memory.state not in (*ENERGISED, State.TRIPPED) and not (waits or asked)


def _charging(memory: Memory) -> bool:
    """With nothing ordered that is not seen yet: no charger leaves an order alone for `SLOWLY_S`."""
    return memory.state is State.CHARGING and memory.stage.ran and memory.sequence.order is None


def _energised(memory: Memory) -> bool:
    return memory.state in ENERGISED


ENDINGS: tuple[Ending, ...] = (
    Ending("to standby", "an operator's stop leads to verified standby wherever the charger obeys",
           "obeys", "healthy", 10.0, _stands_by, Request.STOP),
    Ending("to standby, no battery", "the same without a battery",
           "obeys", "absent", 10.0, _stands_by, Request.STOP),
    Ending("named", "a charger that cannot be stopped is named: UNCONTROLLABLE or OFFLINE",
           "runs, whatever it is told", "healthy", 10.0, _uncontrollable, Request.STOP),
    Ending("named, silent", "a charger that says nothing is named, too",
           "silent", "healthy", 10.0, _called, Request.STOP),
    Ending("charges", "a healthy battery is charged wherever no person must act first, also after every pause",
           "obeys", "healthy", RECOVERY_S, _charges, first_s=SLOWLY_S, asked_of=_free),
    Ending("charges, as measured", "the same where charger and BMU measure a little differently",
           "obeys", "measured differently", RECOVERY_S, _charges, first_s=SLOWLY_S, asked_of=_free),
    Ending("wakes", "a deeply discharged pack is precharged",
           "obeys", "deeply discharged", RECOVERY_S, _wakes, first_s=SLOWLY_S, asked_of=_free),
    Ending("full", "a charge is over when the pack is full, or at its target",
           "obeys", "full", HELD_S, _full, asked_of=_charging),
    Ending("ends", "a charge that leads nowhere is ended by a limit",
           "obeys", "healthy", 76 * 3600.0, _ended, first_s=SLOWLY_S, asked_of=_energised),
)  # fmt: skip


#: What is broken, by what, from which of the places, and the moves that lead there.
Broken = tuple[str, str, int, list[Move]]


def reaches(explorer: Explorer, endings: Sequence[Ending] = ENDINGS) -> None:
    """Hold every ending against every node, and every property on the way; the first node that breaks one is kept."""
    batteries = {battery for _, battery in explorer.walk.inputs.constants()}
    places = [node.place for node in explorer.nodes]
    jobs = [(ENDINGS.index(ending), places) for ending in endings if ending.battery in batteries]
    _keep(explorer, explorer.nodes, explorer.each(_missed, jobs))


def settles(explorer: Explorer, some: Iterable[Node] | None = None) -> None:
    """No livelock: every node (or some of them) comes to rest in every lasting surrounding."""
    nodes = explorer.nodes if some is None else list(some)
    places = [node.place for node in nodes]
    soon = [explorer.soon.get(explorer.walk.gist(place.memory), {}) for place in places]
    constants = list(explorer.walk.inputs.constants())
    jobs = [
        ([(*one, [known.get(one) for known in soon]) for one in constants[at : at + TOGETHER]], places)
        for at in range(0, len(constants), TOGETHER)
    ]
    _keep(explorer, nodes, explorer.each(_endless, jobs))


def _keep(explorer: Explorer, nodes: Sequence[Node], found: Iterable[Sequence[Broken]]) -> None:
    for name, text, number, moves in chain.from_iterable(found):
        explorer.find(name, text, nodes[number], moves)


def _missed(walk: Walk, which: int, places: Sequence[Place]) -> list[Broken]:
    """The first place that does not end so, and what is broken on the way.

    Most ways soon lead to where one from another place has been, and from there on are the same.
    """
    ending = ENDINGS[which]
    first = Move(ending.first_s, ending.charger, ending.battery, ending.request)
    found: list[Broken] = []
    left_s: dict[object, float] = {}  # from what was passed on the ways so far to their end
    for number, place in enumerate(places):
        if not ending.asked_of(place.memory):
            continue
        moves: list[Move] = []
        passed: dict[object, float] = {}
        latest_s = place.now_s + ending.first_s + ending.within_s
        state, end_s = place.memory.state, inf
        for taken in lasting(walk, place, first):
            moves.append(taken.move)
            found += [(name, text, number, [*moves]) for name, text in walk.news(taken)]
            state, key = taken.after.state, details(taken.after)
            end_s = taken.now_s + (0.0 if ending.reached(taken) else left_s.get(key, inf))
            if end_s <= latest_s or taken.now_s > latest_s:
                break
            passed[key] = taken.now_s
        if end_s > latest_s:
            text = f"{ending.about}: not within {ending.within_s:g} s, but {state}"
            return [*found, (ending.name, text, number, moves)]
        left_s |= {key: max(end_s - passed_s, left_s.get(key, 0.0)) for key, passed_s in passed.items()}
    return found


#: A charger, a battery, and the gist after a moment with them, where it is known, of each place.
Surroundings = tuple[str, str, Sequence[object]]


def _endless(walk: Walk, surroundings: Sequence[Surroundings], places: Sequence[Place]) -> list[Broken]:
    """The first place from which the state changes for ever, in each of these surroundings, and what is broken."""
    return [broken for one in surroundings for broken in _circles(walk, one, places)]


def _circles(walk: Walk, surroundings: Surroundings, places: Sequence[Place]) -> list[Broken]:
    charger, battery, soon = surroundings
    settled: set[object] = set()
    found: list[Broken] = []
    for number, place in enumerate(places):
        own = walk.gist(place.memory)
        if own in settled or not walk.inputs.tells(battery, place.memory.state):
            continue
        if soon[number] in settled:
            settled.add(own)
            continue
        changes = 0
        moves: list[Move] = []
        passed: set[object] = {own}
        for taken in lasting(walk, place, Move(TICK_S, charger, battery)):
            moves.append(taken.move)
            found += [(name, text, number, [*moves]) for name, text in walk.news(taken)]
            key = walk.gist(taken.after)
            if key in settled:
                break
            passed.add(key)
            changes += taken.after.state is not taken.before.state
            if changes == PATIENCE:
                text = f"{PATIENCE} changes of state without news (charger: {charger}; battery: {battery})"
                return [*found, ("no livelock", text, number, moves[:SHOWN])]
        settled |= passed
    return found


def lasting(walk: Walk, place: Place, first: Move) -> Iterator[Taken]:
    """What comes of it when the surroundings of a move last: steps until nothing has changed for a long time."""
    move, order = first, place.memory.sequence.order
    rungs = _ladder()
    while True:
        taken = walk.take(place, move)
        yield taken
        if taken.error:
            return
        if (taken.after.state, taken.decision.command) != (taken.before.state, order):
            order, rungs = taken.decision.command, _ladder()
        place = Place(taken.after, taken.now_s)
        dt_s = next(rungs, None)
        if dt_s is None:
            return
        move = Move(dt_s, first.charger, first.battery)


def _ladder() -> Iterator[float]:
    return (dt_s for times, dt_s in LADDER for _ in range(times))
