"""Repeats decisions from a recording: with the same rules they must be the same, bit for bit.

It compares each decision with the journal (state, reason, command, faults, session) and, wherever the recording has a
complete snapshot, the whole memory that results from all decisions before.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory, names, value_of
from orchestrator.core.rules import Rules
from orchestrator.model import Decision
from orchestrator.service.records import decision_lines, without_texts
from orchestrator.workbench.replay.events import Event
from orchestrator.workbench.replay.recording import Recorded


@dataclass(frozen=True, slots=True)
class Again:
    """One repeated decision. `memory` is its input, `after` its result."""

    recorded: Recorded
    rules: Rules
    memory: Memory
    decision: Decision
    after: Memory
    wrong: str = ""  #: the difference from the recording


class Repeater:
    """Repeats one bay's decisions as they come, with the memory left by the previous one; after a gap, the recorded."""

    def __init__(self) -> None:
        self._memory: Memory | None = None
        self._rules: Rules | None = None
        self._before: Decision | None = None

    def take(self, recorded: Recorded) -> Again:
        """Repeat this decision."""
        wrong, before = self._begin(recorded), self._before
        memory, rules = self._memory, self._rules
        assert memory is not None
        assert rules is not None
        decision, after = decide(recorded.at_s, recorded.snapshot, memory, rules)
        if not recorded.snapshot.internal and not recorded.unsure and (before is not None or memory.last_s is None):
            lines = [] if decision == before else list(decision_lines(before, decision))
            wrong = wrong or _said_otherwise(recorded, lines)
        self._memory, self._before = after, decision
        return Again(recorded, rules, memory, decision, after, wrong)

    def _begin(self, recorded: Recorded) -> str:
        """Go on with the recorded memory, if there is one; returns how it differs from ours."""
        if recorded.memory is None or recorded.rules is None:
            return ""
        ours, self._memory, self._rules = self._memory, recorded.memory, recorded.rules
        if recorded.gap or recorded.memory.last_s is None:
            self._before = None  # the previous decision is unknown, or there was none
        elif ours is not None and ours.last_s == recorded.memory.last_s:
            return _differs(ours, recorded.memory)
        return ""


def again(steps: Iterable[Recorded]) -> Iterator[Again]:
    """Repeat each decision of a bay."""
    return map(Repeater().take, steps)


def _differs(ours: Memory, recorded: Memory) -> str:
    """The first value of the memory that differs from the recorded one."""
    for name in names():
        now, was = value_of(ours, name), value_of(recorded, name)
        if now != was:
            return f"memory.{name} was {was!r} and is {now!r}"
    return ""


def _said_otherwise(recorded: Recorded, lines: Sequence[Event]) -> str:
    if not lines and not recorded.events:
        return ""
    ours = [json.loads(json.dumps((kind, without_texts(fields)))) for kind, fields in lines]
    theirs = [[kind, without_texts(fields)] for kind, fields in recorded.events]
    if ours == theirs:
        return ""
    was, now = next(pair for pair in zip_longest(theirs, ours, fillvalue="nothing more") if pair[0] != pair[1])
    return f"the journal says {was}, now it is {now}"
