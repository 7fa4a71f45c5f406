"""What to do with a bay when `decide()` itself has raised: stop it, with the usual deadline and alarm.

The charger's readings are not judged here. The memory holds since when the bay is being stopped, so the next decision
continues from there if it does not raise.
"""

from orchestrator.core import operator, safestop, sequence
from orchestrator.core.active import active_faults
from orchestrator.core.contactor import closes
from orchestrator.core.history import stage
from orchestrator.core.memory import FaultMemory, Memory
from orchestrator.core.parts import changed
from orchestrator.core.safestop import OBEY_STOP_S
from orchestrator.core.states import UNVERIFIED
from orchestrator.model import STOP, Alarm, Cause, Decision, Request, Snapshot, State

FAULT = "internal"


def carry_on(now_s: float, snapshot: Snapshot, memory: Memory, error: str, bay: str = "BAY") -> tuple[Decision, Memory]:
    """The decision and the memory after an exception with the text `error`; `bay` is the name for commands."""
    since_s, cause = memory.stop.stopping_s, None
    state = memory.state
    if state not in UNVERIFIED or since_s is None:
        since_s, state, cause = now_s, State.STOPPING, Cause.of("failed", error=error)
        memory = changed(memory, since_s=now_s)
    tried_s = now_s - since_s
    if tried_s >= OBEY_STOP_S:
        state = State.UNCONTROLLABLE
    out = state is State.UNCONTROLLABLE
    why = Cause.of("failed_stopping", error=error)
    if out:
        why = Cause.of("failed_uncontrollable", tried_s=tried_s, error=error)
    memory = changed(
        memory,
        state=state,
        cause=why,
        last_s=now_s,
        closed=closes(state, closed=memory.closed, standby=False),
        faults=_latched(memory, now_s, error),
        operator=operator.stopped(memory.operator, snapshot.asked_by)
        if snapshot.request is Request.STOP
        else memory.operator,
        stop=safestop.failed(memory.stop, now_s, cause),
        stage=stage.not_ready(memory.stage),
        sequence=sequence.ends(memory.sequence),
    )
    refused = snapshot.request is not None and snapshot.request is not Request.STOP
    answer = Cause.of("failed_request", error=error) if refused else None
    level = Alarm.DANGER if out else Alarm.NONE
    decision = Decision(
        memory.state, memory.cause, STOP, faults=active_faults(memory, now_s, bay), alarm=level, closed=memory.closed,
        session=memory.session, answer=answer,
    )  # fmt: skip
    return decision, memory


def _latched(memory: Memory, now_s: float, error: str) -> dict[str, FaultMemory]:
    """The faults, including this one."""
    known = memory.faults.get(FAULT)
    raised_s = known.raised_s if known is not None and known.raised_s is not None else now_s
    what = Cause.of("internal_error", error=error)
    ours = FaultMemory(present=True, raised_s=raised_s, cause=what, latched=True, now=what)
    return {**memory.faults, FAULT: ours}
