"""What to do about a bay when `step()` itself has raised: stop it, by the same deadline and with the same alarm.

Nothing is judged here but the plainest words of the charger. The memory knows since when the bay is being stopped, so
that the next step, if it does not raise, goes on from there.
"""

from orchestrator.core.active import active_faults
from orchestrator.core.contactor import closes
from orchestrator.core.machine import UNVERIFIED
from orchestrator.core.memory import FaultMemory, Memory
from orchestrator.core.operator import STOPPED
from orchestrator.core.safestop import OBEY_STOP_S
from orchestrator.model import STOP, Alarm, Cause, Decision, Request, Snapshot, State

FAULT = "internal"


def carry_on(now_s: float, snapshot: Snapshot, memory: Memory, error: str, bay: str = "BAY") -> tuple[Decision, Memory]:
    """The decision and the memory after an exception, whose words are `error`; `bay` is the name for commands."""
    memory = memory.copy()
    memory.last_s = now_s
    if memory.state not in UNVERIFIED or memory.stopping_s is None:
        memory.stopping_s = memory.since_s = now_s
        memory.state, memory.stop_cause = State.STOPPING, Cause.of("failed", error=error)
    memory.unverified, memory.ready, memory.intends, memory.order = True, False, False, None
    known = memory.faults.get(FAULT)
    since_s = known.raised_s if known is not None and known.raised_s is not None else now_s
    what = Cause.of("internal_error", error=error)
    memory.faults[FAULT] = FaultMemory(present=True, raised_s=since_s, cause=what, latched=True, now=what)
    if snapshot.request is Request.STOP:
        memory.hold = STOPPED
    tried_s = now_s - memory.stopping_s
    if tried_s >= OBEY_STOP_S:
        memory.state = State.UNCONTROLLABLE
    out = memory.state is State.UNCONTROLLABLE
    memory.closed = closes(memory.state, closed=memory.closed, standby=False)
    memory.cause = Cause.of("failed_stopping", error=error)
    if out:
        memory.cause = Cause.of("failed_uncontrollable", tried_s=tried_s, error=error)
    refused = snapshot.request is not None and snapshot.request is not Request.STOP
    answer = Cause.of("failed_request", error=error) if refused else None
    level = Alarm.DANGER if out else Alarm.NONE
    decision = Decision(
        memory.state, memory.cause, STOP, faults=active_faults(memory, now_s, bay), alarm=level, closed=memory.closed,
        session=memory.session, answer=answer,
    )  # fmt: skip
    return decision, memory
