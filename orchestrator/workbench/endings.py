"""What becomes of a bay when nothing happens any more: does it come to rest, and can it always be brought to standby?

Each memory that was explored is left alone in each of the lasting surroundings, with small steps of time after every
change and ever larger ones while there is none. To change for ever without any news from outside is a livelock.
"""

from collections.abc import Iterable, Iterator

from orchestrator.model import Request
from orchestrator.workbench.explore import Ending, Explorer, Move, Node, Taken

TICK_S = 0.25
#: While nothing changes: so many steps of each length. Beyond the last one all timers have run out.
LADDER = ((16, TICK_S), (10, 1.0), (12, 5.0), (12, 30.0), (10, 300.0), (15, 3600.0))
#: More changes of state than this without news: the longest orderly story is three backoffs and a latch.
PATIENCE = 60


def reaches(explorer: Explorer, endings: Iterable[Ending]) -> None:
    """Hold every ending against every node."""
    for ending in endings:
        for node in explorer.nodes:
            steps = _until(explorer, node, ending)
            if steps is not None:
                state = steps[-1].after.state if steps else node.memory.state
                explorer.find(ending.name, f"not within {ending.within_s:g} s, but {state}", node, *steps)
                break


def _until(explorer: Explorer, node: Node, ending: Ending) -> list[Taken] | None:
    """The steps that did not lead there; None if they did."""
    moves = _ticks(ending.charger, ending.battery, ending.request, ending.within_s)
    steps: list[Taken] = []
    for taken in explorer.follow(node, moves):
        steps.append(taken)
        if ending.reached(taken):
            return None
    return steps


def _ticks(charger: str, battery: str, request: Request | None, seconds: float) -> Iterator[Move]:
    yield Move(TICK_S, charger, battery, request)
    for _ in range(round(seconds / TICK_S)):
        yield Move(TICK_S, charger, battery)


def settles(explorer: Explorer, nodes: Iterable[Node] | None = None) -> None:
    """No livelock: every node (or those given) comes to rest in every lasting surrounding."""
    chosen = explorer.nodes if nodes is None else tuple(nodes)
    for charger, battery in explorer.inputs.constants():
        settled: set[object] = set()
        for node in chosen:
            steps = _changes(explorer, node, charger, battery, settled)
            if steps is not None:
                text = f"{PATIENCE} changes of state without news (charger: {charger}; battery: {battery})"
                explorer.find("no livelock", text, node, *steps[-8:])
                return


def _changes(explorer: Explorer, node: Node, charger: str, battery: str, settled: set[object]) -> list[Taken] | None:
    """The steps that changed the state, if they do not end; None, and what was passed is settled, if they do."""
    changes: list[Taken] = []
    passed: set[object] = set()
    while True:
        moves = (Move(dt_s, charger, battery) for times, dt_s in LADDER for _ in range(times))
        for taken in explorer.follow(node, moves):
            key = explorer.gist(taken.after)
            if key in settled:
                settled |= passed
                return None
            node = Node(taken.after, taken.now_s, taken, node)
            if taken.after.state is not taken.before.state:
                passed.add(key)
                changes.append(taken)
                break
        else:
            settled |= passed
            return None
        if len(changes) >= PATIENCE:
            return changes
