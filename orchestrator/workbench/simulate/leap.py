"""Time steps that stretch: when steps may be left out, and what they would have left in the memory.

Theory of operation. While nothing happens, one `step()` after another says the same. A leap takes the last of them
only. It counts if its outline, all that a decision says and all that the core keeps but measured values, is that from
before the leap; else it is taken back and tried again with half the length, down to one tick. So whatever happens is
decided at its own tick. What the core sums up or keeps from step to step (the charge, the temperatures of the last
minutes) is brought up to the tick before the last one, from what the plant did meanwhile.
"""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.core.memory import Memory
from orchestrator.core.states import ENERGISED
from orchestrator.core.track import thinned
from orchestrator.model import Decision

Outline = tuple[object, ...]


#: What the memory carries that changes only when something happens.
EVENTFUL = (
    "since_s", "resets", "hold", "paused", "stop_cause", "full_pct", "boots", "resumed", "ran", "shown", "order",
    "limit", "limit_before", "closed", "charge_step", "exchange", "reached_s", "raise_s", "taper_s", "qualified_s",
    "runs_s", "stopping_s", "verified_s", "returns", "unverified", "left_s", "left_as", "returned_s", "reverts",
    "confirmed", "ready", "intends", "rows", "row_returns", "full_s",
)  # fmt: skip
#: What it sums up, as long as there is anything to sum up.
SUMS = ("idle_s", "search_s", "wake_s")


def outline(decision: Decision, memory: Memory) -> Outline:
    """All that changes only when something happens; equal outlines, and nothing has happened in between."""
    witnessed, session = memory.witnessed, memory.session
    return (
        decision.state,
        decision.command,
        decision.setpoint,
        decision.step,
        decision.alarm,
        decision.closed,
        *(getattr(memory, name) for name in EVENTFUL),
        *(getattr(memory, name) > 0 for name in SUMS),
        (session.rise_v, session.full) if session is not None else None,
        witnessed.stop_s,
        witnessed.proved,
        tuple((name, f.present, f.raised_s, f.clean_s, f.latched, f.strikes) for name, f in memory.faults.items()),
    )


def brought_up(
    memory: Memory, before_s: float, temperatures: Sequence[tuple[float, float]], charged_ah: float, charged_wh: float
) -> Memory:
    """The memory as the steps that are left out would have left it.

    `before_s` is the last of them; `temperatures` are what the BMU told, (t_s, °C), every time one was due to be kept
    and at `before_s`, or none where it told nothing; `charged_ah`, `charged_wh` were delivered meanwhile.
    """
    memory = memory.copy()
    for sample in temperatures:
        memory.warmth = thinned(memory.warmth, sample)
        memory.sample = sample
    session = memory.session
    if session is not None:
        memory.counted_t_s = before_s
        if memory.state in ENERGISED:
            charged_ah, charged_wh = session.charged_ah + charged_ah, session.charged_wh + charged_wh
            memory.session = replace(session, charged_ah=charged_ah, charged_wh=charged_wh)
    return memory
