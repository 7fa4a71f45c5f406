"""One bay's part of the status document, but for what its runner alone knows: made of a decision and its input."""

from orchestrator.core.finish import once
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import Decision, Snapshot
from orchestrator.service.outlook import outlook
from orchestrator.service.status import bay_status, told
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import fields


def described(
    name: str,
    decision: Decision,
    snapshot: Snapshot,
    memory: Memory | None,
    rules: Rules,
    clock: WallClock,
    language: str,
    *,
    closely: bool,
) -> dict[str, object]:
    """What it does and why, what limits it, what comes next."""
    decision = told(decision, snapshot, memory, rules)
    asked = once(memory.operator) if memory is not None else None
    target = {"soc_pct": asked.param("target_pct"), **(fields(clock.told(asked), language) or {})} if asked else None
    return {
        **bay_status(name, snapshot, decision, clock.now_s, clock.wall_s, language),
        **outlook(decision, snapshot, memory, rules, clock, language, closely=closely),
        "target": target,
    }
