"""Walks everything that `decide()` can reach, breadth-first, and checks properties against every decision on the way.

Inputs are cut into classes (`inputs.py`) and jumps of time; memories are grouped by `gist.py`, and the first memory of
each gist represents the others. So every finding is real, with the shortest story that leads to it, and anything not
found is absent up to these cuts. Properties are data (`properties.py`); nothing here knows their meaning.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory
from orchestrator.core.parts import made
from orchestrator.core.persisted import Persisted
from orchestrator.core.rules import Rules
from orchestrator.model import Cause, Decision, Snapshot, State
from orchestrator.workbench.prove.gist import gist, outline
from orchestrator.workbench.prove.properties import Property
from orchestrator.workbench.prove.story import BEGIN_S, TICK_S, Counterexample, Move, Taken

Decide = Callable[[float, Snapshot, Memory, Rules], tuple[Decision, Memory]]
T = TypeVar("T")


class Inputs(Protocol):
    """The classes of inputs."""

    def moves(self, state: State) -> Iterable[Move]:
        """Everything that may happen next in a state, one thing at a time."""

    def pairs(self, state: State) -> Iterable[Move]:
        """Every combination of a charger's and a battery's next input that is not among the moves."""

    def constants(self) -> Iterable[tuple[str, str]]:
        """Charger and battery of each situation that may last for ever."""

    def tells(self, battery: str, state: State) -> bool:
        """Whether this battery is a separate class in that state."""

    def snapshot(self, move: Move, now_s: float, memory: Memory) -> Snapshot:
        """The input of the decision."""


@dataclass(frozen=True, slots=True)
class Place:
    """A memory and its time: the starting point of a decision."""

    memory: Memory
    now_s: float


@dataclass(frozen=True, slots=True)
class Expanded:
    """Everything one decision away from a place."""

    reached: Sequence[tuple[object, Move, Place]]  #: the first place of each gist, and the move that leads there
    broken: Sequence[tuple[str, str, Move]]  #: each violated property, how it is violated, and the move that shows it
    changes: frozenset[tuple[State, State]]
    steps: int
    soon: Mapping[tuple[str, str], object]  #: the gist after the next moment in lasting surroundings


@dataclass(slots=True)
class Walk:
    """The possible inputs and the required properties; makes decisions, and remembers only what it has reported."""

    rules: Rules
    inputs: Inputs
    properties: Sequence[Property]
    gist: Callable[[Memory], object] = gist
    decide: Decide = decide
    _told: set[object] = field(default_factory=set)  # gists already reached, and names of violated properties

    def take(self, place: Place, move: Move) -> Taken:
        """Make one decision from there."""
        now_s = place.now_s + move.dt_s
        memory = Persisted.of(place.memory, now_s).memory(now_s) if move.restart else place.memory
        snapshot = self.inputs.snapshot(move, now_s, memory)
        try:
            decision, after = self.decide(now_s, snapshot, memory, self.rules)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
            stays = Decision(place.memory.state, Cause.of("failed", error=f"{type(error).__name__}: {error}"))
            return Taken(move, now_s, snapshot, place.memory, stays, place.memory, self.rules, error=repr(error))
        return made(Taken, move, now_s, snapshot, place.memory, decision, after, self.rules, "")

    def broken(self, taken: Taken) -> Sequence[tuple[str, str]]:
        """The name of each property that the decision violates, and how."""
        if taken.error:
            return [("no exception", f"decide() raised {taken.error}")]
        return [(rule.name, wrong) for rule in self.properties if (wrong := rule.check(taken)) is not None]

    def news(self, taken: Taken) -> Iterator[tuple[str, str]]:
        """Violations that have not been reported before."""
        for name, text in self.broken(taken):
            if name not in self._told:
                self._told.add(name)
                yield name, text

    def follow(self, place: Place, moves: Iterable[Move]) -> Iterator[Taken]:
        """Make one decision after another from there, until one raises an exception."""
        for move in moves:
            taken = self.take(place, move)
            yield taken
            if taken.error:
                return
            place = Place(taken.after, taken.now_s)

    def expand(self, place: Place, *, in_pairs: bool) -> Expanded:
        """Try every move from there; omits whatever was reported before."""
        reached, broken, changes, steps = [], [], set(), 0
        state, soon = place.memory.state, {}
        for move in (*self.inputs.moves(state), *(self.inputs.pairs(state) if in_pairs else ())):
            taken = self.take(place, move)
            steps += 1
            broken += [(name, text, move) for name, text in self.news(taken)]
            if taken.before.state is not taken.after.state and not move.restart:  # a restart is not a change of state
                changes.add((taken.before.state, taken.after.state))
            if taken.error:
                continue
            key = self.gist(taken.after)
            if move.lasts and move.dt_s == TICK_S:
                soon[move.charger, move.battery] = key
            if key not in self._told:
                self._told.add(key)
                reached.append((key, move, Place(taken.after, taken.now_s)))
        return Expanded(reached, broken, frozenset(changes), steps, soon)


class Each(Protocol):
    """Applies a function to many jobs, in order: here, or in several processes."""

    def __call__(self, function: Callable[..., T], jobs: deque[Any]) -> Iterator[T]:
        """`function(walk, *job)` for each job, also for those that are added while results are taken."""


@dataclass(frozen=True, slots=True)
class Node:
    """A place that was reached, and how; the first has no parent."""

    place: Place
    move: Move | None = None
    parent: "Node | None" = None

    @property
    def way(self) -> tuple[Move, ...]:
        """The moves that led there."""
        return (*self.parent.way, self.move) if self.parent is not None and self.move is not None else ()


@dataclass(slots=True)
class Explorer:
    """`run` explores; then `nodes` has what was reached, `found` at most one counterexample per property."""

    walk: Walk
    each: Each
    watch: Callable[[str], None] = lambda _: None  #: called regularly with what has been done so far
    nodes: list[Node] = field(default_factory=list)
    steps: int = 0
    found: dict[str, Counterexample] = field(default_factory=dict)
    changes: set[tuple[State, State]] = field(default_factory=set)  #: changes of state seen
    soon: dict[object, Mapping[tuple[str, str], object]] = field(default_factory=dict)  #: by gist, as in `Expanded`
    _paired: set[object] = field(default_factory=set)  # outlines

    def run(self, until: str = "", most: int = 1_000_000) -> None:
        """Explore everything reachable, or until the property `until` is violated, or up to `most` nodes."""
        first = Node(Place(Memory(), BEGIN_S))
        seen: set[object] = {self.walk.gist(first.place.memory)}
        self.nodes = [first]
        jobs = deque([self._job(first)])
        for number, expanded in enumerate(self.each(_expand, jobs)):
            jobs += map(self._job, self._learn(self.nodes[number], expanded, seen))
            if until in self.found or len(self.nodes) >= most:
                return

    def _job(self, node: Node) -> tuple[Place, bool]:
        return node.place, self._first_of_its_outline(node)

    def _first_of_its_outline(self, node: Node) -> bool:
        """Pairs are tried only once per outline, because there are so many."""
        shape = outline(node.place.memory)
        new = shape not in self._paired
        self._paired.add(shape)
        return new

    def _learn(self, node: Node, expanded: Expanded, seen: set[object]) -> Iterator[Node]:
        self.steps += expanded.steps
        self.watch(f"{self.steps:,} decisions explored")
        self.changes |= expanded.changes
        self.soon[self.walk.gist(node.place.memory)] = expanded.soon
        for name, text, move in expanded.broken:
            self.find(name, text, node, (move,))
        for key, move, place in expanded.reached:
            if key not in seen:
                seen.add(key)
                new = Node(place, move, node)
                self.nodes.append(new)
                yield new

    def find(self, name: str, text: str, node: Node, more: Sequence[Move]) -> None:
        """Record a counterexample: the way to the node, and what followed."""
        if name not in self.found:
            story = self.walk.follow(Place(Memory(), BEGIN_S), (*node.way, *more))
            self.found[name] = Counterexample(name, text, tuple(story))


def _expand(walk: Walk, place: Place, in_pairs: bool) -> Expanded:  # noqa: FBT001 - a job's arguments have no names
    return walk.expand(place, in_pairs=in_pairs)
