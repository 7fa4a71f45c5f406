"""Time steps that stretch: when steps may be left out, and what they would have left in the memory.

Theory of operation. While nothing happens, one `decide()` after another says the same. A leap takes the last of them
only. It counts if its outline, all that a decision says and all that the core keeps but measured values, is that from
before the leap; else it is taken back and tried again with half the length, down to one tick. So whatever happens is
decided at its own tick. What the core sums up or keeps from step to step (the charge, the temperatures of the last
minutes) is brought up to the tick before the last one, from what the plant did meanwhile.
"""

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

from orchestrator.core.history.battery import thinned
from orchestrator.core.memory import RECORDS, FaultMemory, Memory, paths, with_values
from orchestrator.core.parts import Kind
from orchestrator.core.states import ENERGISED
from orchestrator.model import Decision, Session

Outline = tuple[object, ...]


#: What the memory carries that changes only when something happens …
EVENTS = attrgetter(*paths(Kind.EVENT))
#: … and what it sums up, as long as there is anything to sum up.
TOTALS = attrgetter(*paths(Kind.TOTAL))
FAULT_EVENTS, SESSION_EVENTS = (attrgetter(*RECORDS[record][Kind.EVENT]) for record in (FaultMemory, Session))


def outline(decision: Decision, memory: Memory) -> Outline:
    """All that changes only when something happens; equal outlines, and nothing has happened in between."""
    return (
        decision.state,
        decision.command,
        decision.setpoint,
        decision.step,
        decision.alarm,
        EVENTS(memory),
        tuple(value > 0 for value in TOTALS(memory)),
        SESSION_EVENTS(memory.session) if memory.session is not None else None,
        tuple((name, FAULT_EVENTS(fault)) for name, fault in memory.faults.items()),
    )


def brought_up(
    memory: Memory, before_s: float, temperatures: Sequence[tuple[float, float]], charged_ah: float, charged_wh: float
) -> Memory:
    """The memory as the steps that are left out would have left it.

    `before_s` is the last of them; `temperatures` are what the BMU told, (t_s, °C), every time one was due to be kept
    and at `before_s`, or none where it told nothing; `charged_ah`, `charged_wh` were delivered meanwhile.
    """
    warmth, newest = memory.battery.warmth, memory.battery.sample
    for sample in temperatures:
        warmth, newest = thinned(warmth, sample), sample
    memory = with_values(memory, warmth=warmth, sample=newest)
    session = memory.session
    if session is None:
        return memory
    if memory.state in ENERGISED:
        charged_ah, charged_wh = session.charged_ah + charged_ah, session.charged_wh + charged_wh
        session = replace(session, charged_ah=charged_ah, charged_wh=charged_wh)
    return with_values(memory, counted_t_s=before_s, session=session)
