"""Follows every explored memory to its end in surroundings that last: does it reach the endings, does it settle?

Each memory is left alone, with small steps of time after every change of state or command, and ever larger ones while
there is none. To change for ever without news from outside is a livelock.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from math import inf

from orchestrator.workbench.prove.endings import ENDINGS, Ending
from orchestrator.workbench.prove.explore import Explorer, Node, Place, Walk
from orchestrator.workbench.prove.gist import details
from orchestrator.workbench.prove.story import TICK_S, Move, Taken

#: While nothing changes: this many steps of each length. After the last one all timers have run out.
LADDER = ((16, TICK_S), (8, 1.0), (8, 5.0), (8, 30.0), (8, 300.0), (4, 3600.0), (6, 12 * 3600.0))
#: More changes of state than this without news: the longest orderly story is three backoffs and a latch.
PATIENCE = 60
#: … of which a story shows this many steps.
SHOWN = 40
#: So many surroundings are looked at in one job: its places are many, and go to another process with it.
TOGETHER = 8

#: What is broken, by what, from which of the places, and the moves that lead there.
Broken = tuple[str, str, int, list[Move]]


def reaches(explorer: Explorer, endings: Sequence[Ending] = ENDINGS) -> None:
    """Hold every ending against every node, and every property on the way; the first node that breaks one is kept."""
    batteries = {battery for _, battery in explorer.walk.inputs.constants()}
    places = [node.place for node in explorer.nodes]
    jobs = deque((ENDINGS.index(ending), places) for ending in endings if ending.battery in batteries)
    _keep(explorer, explorer.nodes, explorer.each(_missed, jobs), f"of {len(jobs)} endings")


def settles(explorer: Explorer, some: Iterable[Node] | None = None) -> None:
    """No livelock: every node (or some of them) comes to rest in every lasting surrounding."""
    nodes = explorer.nodes if some is None else list(some)
    places = [node.place for node in nodes]
    soon = [explorer.soon.get(explorer.walk.gist(place.memory), {}) for place in places]
    constants = list(explorer.walk.inputs.constants())
    jobs = deque(
        ([(*one, [known.get(one) for known in soon]) for one in constants[at : at + TOGETHER]], places)
        for at in range(0, len(constants), TOGETHER)
    )
    _keep(explorer, nodes, explorer.each(_endless, jobs), f"of {len(jobs)} searches for livelocks")


def _keep(explorer: Explorer, nodes: Sequence[Node], found: Iterable[Sequence[Broken]], whole: str) -> None:
    for done, broken in enumerate(found, start=1):
        for name, text, number, moves in broken:
            explorer.find(name, text, nodes[number], moves)
        explorer.watch(f"{done} {whole}")


def _missed(walk: Walk, which: int, places: Sequence[Place]) -> list[Broken]:
    """The first place that does not end so, and what is broken on the way.

    Steps may be longer than what is left of the time: then what counts is the last step at which it had not ended.
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
        latest_s = place.now_s + ending.first_s + ending.limit_s(walk.rules)
        state, before_s, end_s = place.memory.state, place.now_s, inf
        for taken in lasting(walk, place, first):
            moves.append(taken.move)
            found += [(name, text, number, [*moves]) for name, text in walk.news(taken)]
            state, key = taken.after.state, details(taken.after)
            end_s = before_s if ending.reached(taken) else taken.now_s + left_s.get(key, inf)
            if end_s <= latest_s or taken.now_s > latest_s:
                break
            passed[key] = before_s = taken.now_s
        if end_s > latest_s:
            text = f"{ending.about}: not within {ending.limit_s(walk.rules):g} s, but {state}"
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
    move, command = first, place.memory.sequence.command
    rungs = _ladder()
    while True:
        taken = walk.take(place, move)
        yield taken
        if taken.error:
            return
        if (taken.after.state, taken.decision.command) != (taken.before.state, command):
            command, rungs = taken.decision.command, _ladder()
        place = Place(taken.after, taken.now_s)
        dt_s = next(rungs, None)
        if dt_s is None:
            return
        move = Move(dt_s, first.charger, first.battery)


def _ladder() -> Iterator[float]:
    return (dt_s for times, dt_s in LADDER for _ in range(times))
