"""Repeats decisions from a recording: with the same rules they must be the same, bit for bit.

It compares each decision with the journal (state, reason, command, faults, session) and, wherever the recording has a
complete snapshot, the whole memory that results from all decisions before.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import zip_longest

from orchestrator.core.decide import decide
from orchestrator.core.memory import Memory, names, value_of
from orchestrator.core.rules import Rules
from orchestrator.model import Decision
from orchestrator.service.records import decision_lines, without_texts
from orchestrator.workbench.replay.recording import Event, Recorded


@dataclass(frozen=True, slots=True)
class Again:
    """One repeated decision. `memory` is its input, `after` its result."""

    recorded: Recorded
    rules: Rules
    memory: Memory
    decision: Decision
    after: Memory
    wrong: str = ""  #: the difference from the recording


def again(steps: Iterable[Recorded]) -> Iterator[Again]:
    """Repeat each decision with the memory left by the previous one; after a gap, with the recorded memory."""
    memory: Memory | None = None
    rules: Rules | None = None
    before: Decision | None = None
    for recorded in steps:
        wrong = ""
        if recorded.memory is not None and recorded.rules is not None:
            if recorded.gap or recorded.memory.last_s is None:
                before = None  # the previous decision is unknown, or there was none
            elif memory is not None and memory.last_s == recorded.memory.last_s:
                wrong = _differs(memory, recorded.memory)
            memory, rules = recorded.memory, recorded.rules
        assert memory is not None
        assert rules is not None
        decision, after = decide(recorded.at_s, recorded.snapshot, memory, rules)
        if not recorded.snapshot.internal and not recorded.unsure and (before is not None or memory.last_s is None):
            wrong = wrong or _said_otherwise(recorded, list(decision_lines(before, decision)))
        yield Again(recorded, rules, memory, decision, after, wrong)
        memory, before = after, decision


def _differs(ours: Memory, recorded: Memory) -> str:
    """The first value of the memory that differs from the recorded one."""
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
