"""Walks everything that `step()` can come to, breadth-first, and holds properties against every step on the way.

What goes in is cut into classes (`inputs.py`) and jumps of time; what is remembered is cut by `gist`, and the first
memory of each gist stands for all of them. So what is found is real, with the shortest story that leads to it, and what
is not found is absent up to these cuts. Properties are data (`properties.py`); nothing here knows what they mean.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from orchestrator.core.latches import effect, raised
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.core.step import step
from orchestrator.model import ENERGISED, Decision, Request, Snapshot, State

#: Where time begins; not 0, so that nobody takes "never" for a time.
BEGIN_S = 1000.0

Step = Callable[[float, Snapshot, Memory, Rules], tuple[Decision, Memory]]


@dataclass(frozen=True, slots=True)
class Move:
    """What happens between two steps: time passes, and then this is what the devices and the operator say."""

    dt_s: float
    charger: str  #: the name of a class of inputs
    battery: str
    request: Request | None = None
    internal: str = ""

    def __str__(self) -> str:
        asked = f", operator: {self.request}" if self.request else ""
        broke = f", internal error: {self.internal}" if self.internal else ""
        return f"charger: {self.charger}; battery: {self.battery}{asked}{broke}"


class Inputs(Protocol):
    """The classes that inputs are cut into."""

    def moves(self) -> Iterable[Move]:
        """All that may happen next, one thing at a time."""

    def pairs(self) -> Iterable[Move]:
        """All that may happen next, a charger's and a battery's at once."""

    def constants(self) -> Iterable[tuple[str, str]]:
        """Charger and battery of each surrounding that may last for ever."""

    def snapshot(self, move: Move, now_s: float, memory: Memory) -> Snapshot:
        """What the step is given."""


@dataclass(frozen=True, slots=True)
class Taken:
    """One step as it was taken."""

    move: Move
    now_s: float
    snapshot: Snapshot
    before: Memory
    decision: Decision
    after: Memory
    rules: Rules


@dataclass(frozen=True, slots=True)
class Property:
    """What every step must fulfil; `check` returns what is wrong, or None."""

    name: str
    about: str
    check: Callable[[Taken], str | None]


@dataclass(frozen=True, slots=True)
class Ending:
    """What must become of every memory within `within_s` in lasting surroundings, after the operator's `request`."""

    name: str
    about: str
    charger: str
    battery: str
    request: Request | None
    within_s: float
    reached: Callable[[Taken], bool]


@dataclass(slots=True)
class Node:
    """The first memory of its gist, and the step that led to it; the very first has none."""

    memory: Memory
    now_s: float
    taken: Taken | None = None
    parent: "Node | None" = None
    depth: int = 0


@dataclass(frozen=True, slots=True)
class Counterexample:
    """A property that does not hold, and the shortest story that shows it."""

    name: str
    text: str
    story: tuple[Taken, ...]

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.text}"]
        for taken in self.story:
            order = taken.decision.command
            said = f"{order.action} {order.value}" if order else "only polls"
            answer = f"; answer: {taken.decision.answer}" if taken.decision.answer else ""
            lines.append(f"  t = {taken.now_s - BEGIN_S:9.2f} s  {taken.move}")
            lines.append(f"      → {taken.decision.state}: {taken.decision.reason}; {said}{answer}")
        return "\n".join(lines)


def outline(memory: Memory) -> tuple[object, ...]:
    """The coarsest cut: where a bay is, and the worst fault's effect."""
    faults = raised(memory.faults)
    return memory.state, effect(*faults[0]) if faults else None


def gist(memory: Memory) -> tuple[object, ...]:
    """What tells two memories apart here: what decides where a bay can go, without times, values and texts."""
    energised = memory.state in ENERGISED
    return (
        *outline(memory),
        any(fault.latched for fault in memory.faults.values()),
        bool(memory.hold),
        memory.paused,
        memory.session is not None,
        memory.full_pct is not None,
        memory.qualified_s is not None,
        energised and (memory.resumed, memory.ran, memory.order and memory.order.action),
    )


@dataclass(slots=True)
class Explorer:
    """`run` explores; then `nodes` has what was reached, `found` at most one counterexample for each property."""

    rules: Rules
    inputs: Inputs
    properties: Sequence[Property]
    gist: Callable[[Memory], object] = gist
    step: Step = step
    nodes: list[Node] = field(default_factory=list)
    steps: int = 0
    found: dict[str, Counterexample] = field(default_factory=dict)
    changes: set[tuple[State, State]] = field(default_factory=set)  #: changes of state that were seen
    _paired: set[object] = field(default_factory=set)  # outlines

    def run(self, until: str = "", most: int = 1_000_000) -> None:
        """Everything that can be reached; or until the property `until` is found not to hold, or `most` nodes."""
        first = Node(Memory(), BEGIN_S)
        self.nodes = [first]
        seen, waiting = {self.gist(first.memory)}, deque([first])
        while waiting and until not in self.found and len(self.nodes) < most:
            node = waiting.popleft()
            for move in self._moves(node.memory):
                taken = self.take(node, move)
                if taken is None or (key := self.gist(taken.after)) in seen:
                    continue
                seen.add(key)
                reached = Node(taken.after, taken.now_s, taken, node, node.depth + 1)
                self.nodes.append(reached)
                waiting.append(reached)

    def _moves(self, memory: Memory) -> Iterator[Move]:
        """Pairs only once for each outline: they are many."""
        yield from self.inputs.moves()
        if (shape := outline(memory)) not in self._paired:
            self._paired.add(shape)
            yield from self.inputs.pairs()

    def take(self, node: Node, move: Move) -> Taken | None:
        """One step from there, held against every property; None where it raised an exception."""
        now_s = node.now_s + move.dt_s
        snapshot = self.inputs.snapshot(move, now_s, node.memory)
        self.steps += 1
        try:
            decision, after = self.step(now_s, snapshot, node.memory, self.rules)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
            stays = Decision(node.memory.state, f"{type(error).__name__}: {error}")
            taken = Taken(move, now_s, snapshot, node.memory, stays, node.memory, self.rules)
            self.find("no exception", f"step() raised {error!r}", node, taken)
            return None
        taken = Taken(move, now_s, snapshot, node.memory, decision, after, self.rules)
        if node.memory.state is not after.state:
            self.changes.add((node.memory.state, after.state))
        for rule in self.properties:
            if rule.name not in self.found and (wrong := rule.check(taken)) is not None:
                self.find(rule.name, wrong, node, taken)
        return taken

    def find(self, name: str, text: str, node: Node, *more: Taken) -> None:
        """Keep a counterexample: the way to the node, and what followed."""
        if name not in self.found:
            self.found[name] = Counterexample(name, text, (*way(node), *more))

    def follow(self, node: Node, moves: Iterable[Move]) -> Iterator[Taken]:
        """Steps one after another from there."""
        for move in moves:
            taken = self.take(node, move)
            if taken is None:
                return
            yield taken
            node = Node(taken.after, taken.now_s, taken, node, node.depth + 1)


def way(node: Node) -> tuple[Taken, ...]:
    """The steps that led there."""
    steps: list[Taken] = []
    while node.taken is not None and node.parent is not None:
        steps.append(node.taken)
        node = node.parent
    return tuple(reversed(steps))
