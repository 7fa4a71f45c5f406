"""Decisions taken again from what was recorded: with the same rules they must be the same, bit for bit.

Compared is what the journal says of each step (state, reason, order, faults, session) and, wherever the record begins
anew, the whole memory that all steps before have led to.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import zip_longest

from orchestrator.core.memory import Memory, names, value_of
from orchestrator.core.rules import Rules
from orchestrator.core.step import step
from orchestrator.model import Decision
from orchestrator.service.records import decision_lines, without_texts
from orchestrator.workbench.replay.recording import Event, Recorded


@dataclass(frozen=True, slots=True)
class Again:
    """One step, taken again. `memory` is what it was given, `after` what it left."""

    recorded: Recorded
    rules: Rules
    memory: Memory
    decision: Decision
    after: Memory
    wrong: str = ""  #: what is not as it was recorded


def again(steps: Iterable[Recorded]) -> Iterator[Again]:
    """Take each step with the memory that the one before has left; a gap in the record begins with the recorded one."""
    memory: Memory | None = None
    rules: Rules | None = None
    before: Decision | None = None
    for recorded in steps:
        wrong = ""
        if recorded.memory is not None and recorded.rules is not None:
            if recorded.gap or recorded.memory.last_s is None:
                before = None  # of the step before nothing is known, or there was none
            elif memory is not None and memory.last_s == recorded.memory.last_s:
                wrong = _differs(memory, recorded.memory)
            memory, rules = recorded.memory, recorded.rules
        assert memory is not None
        assert rules is not None
        decision, after = step(recorded.at_s, recorded.snapshot, memory, rules)
        if not recorded.snapshot.internal and not recorded.unsure and (before is not None or memory.last_s is None):
            wrong = wrong or _said_otherwise(recorded, list(decision_lines(before, decision)))
        yield Again(recorded, rules, memory, decision, after, wrong)
        memory, before = after, decision


def _differs(ours: Memory, recorded: Memory) -> str:
    """The first value of the memory that is not the recorded one."""
    for name in names():
        now, was = value_of(ours, name), value_of(recorded, name)
        if now != was:
            return f"memory.{name} was {was!r} and is {now!r}"
    return ""


def _said_otherwise(recorded: Recorded, lines: list[Event]) -> str:
    ours = [json.loads(json.dumps((kind, without_texts(fields)))) for kind, fields in lines]
    theirs = [[kind, without_texts(fields)] for kind, fields in recorded.events]
    if ours == theirs:
        return ""
    was, now = next(pair for pair in zip_longest(theirs, ours, fillvalue="nothing more") if pair[0] != pair[1])
    return f"the journal says {was}, now it is {now}"
