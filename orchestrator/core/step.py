"""`step()`: one decision about one bay. The live service, the simulator, the checker and the replay all call this.

facts → what has lasted → the operator's request → faults → the trigger, if any → the state → setpoint → the order.
"""

from dataclasses import replace

from orchestrator.core import latches, limits
from orchestrator.core.active import active_faults
from orchestrator.core.alarm import alarm
from orchestrator.core.contactor import closes
from orchestrator.core.course import course
from orchestrator.core.facts import Facts
from orchestrator.core.machine import fire
from orchestrator.core.memory import Memory
from orchestrator.core.operator import hear
from orchestrator.core.rows import counted
from orchestrator.core.rules import Rules
from orchestrator.core.safestop import follow_stop, must_stop, stands_by
from orchestrator.core.sequence import next_order
from orchestrator.core.track import follow, follow_state
from orchestrator.model import (
    ENERGISED,
    STANDBY,
    STOP,
    ActiveFault,
    Cause,
    ChargeMode,
    Command,
    Decision,
    Effect,
    Precharge,
    Session,
    Setpoint,
    Snapshot,
    State,
    Step,
)

#: What the charger is told in each state in which current flows; the limit of CHARGING comes from the policy.
SETPOINTS: dict[State, tuple[ChargeMode, Precharge]] = {
    State.PRECHARGE_PULSE: (ChargeMode.PRECHARGE, Precharge.PULSE),
    State.PRECHARGE_CONTINUOUS: (ChargeMode.PRECHARGE, Precharge.CONTINUOUS),
    State.CHARGING: (ChargeMode.CHARGE, Precharge.OFF),
}
PRECHARGE = Cause("precharge_step", key="precharge")
#: After these a charge is over. A pause, a stop that is not verified, a device that does not answer and a restart do
#: not end it: its limits would begin anew with each of them.
SESSION_ENDS = frozenset({State.FULL, State.IDLE, State.HELD, State.TRIPPED})
#: … but who waits for a person, or no longer does, has come no farther: what a restart has left open stays open.
ALIKE = frozenset({State.IDLE, State.HELD})


def step(now_s: float, snapshot: Snapshot, memory: Memory, rules: Rules) -> tuple[Decision, Memory]:
    """What to do now, and what to remember.

    `now_s` is monotonic and never goes back between two calls. `memory` is what the call before returned (at first
    `Memory()`) and is not changed. Depends on nothing else, so the same arguments always give the same result.
    """
    last_s, memory = memory.last_s, memory.copy()
    memory.last_s = now_s
    if memory.since_s is None:
        memory.since_s = now_s
    f = Facts(now_s, snapshot, memory, rules)
    follow(f, last_s)
    answer = None
    if snapshot.request is not None:
        answer = hear(memory, snapshot.request, now_s, snapshot.unkept, rules.bay.name)
    memory.faults = latches.update(f)
    faults = active_faults(memory, now_s, rules.bay.name, f, at_rest=stands_by(f))
    ended = _move(f, faults)
    setpoint, chosen = _setpoint(f, faults)
    memory.closed = closes(memory.state, closed=memory.closed, standby=f.standby)
    return (
        Decision(
            state=memory.state,
            cause=memory.cause,
            command=_order(f, setpoint, faults),
            setpoint=setpoint,
            step=chosen,
            faults=faults,
            alarm=alarm(memory, faults),
            closed=memory.closed,
            session=ended or memory.session,
            answer=answer,
        ),
        memory,
    )


def _move(f: Facts, faults: tuple[ActiveFault, ...]) -> Session | None:
    """Let the state follow the facts; the session that has ended by it, if any."""
    memory, before = f.memory, f.memory.state
    trigger, memory.cause = course(f, faults)
    memory.state = fire(before, trigger) if trigger is not None else before
    if memory.state is not before:
        follow_stop(f, before)
        follow_state(f, before)
        if memory.state is State.STOPPING:
            memory.stop_cause = memory.cause
    if memory.session is None or not _is_over(f, before):
        return None
    held = memory.hold if memory.state is State.HELD else None  # the rest of that cause is what to do next
    result = (memory.stop_cause if before is State.STOPPING else held) or memory.cause
    ended = replace(memory.session, result=result)
    memory.session = None
    return ended


def _is_over(f: Facts, before: State) -> bool:
    """Whether the open charge has ended. One that the last run of the service left open ends with its battery."""
    exchanged = f.memory.faults.get("battery_exchanged")
    another = f.departed or (exchanged is not None and exchanged.raised_s is not None)
    after = f.memory.state
    goes_on = after is before or before is State.STARTING or {before, after} == ALIKE
    return after in SESSION_ENDS and (another or not goes_on)


def _setpoint(f: Facts, faults: tuple[ActiveFault, ...]) -> tuple[Setpoint, Step | None]:
    """What the charger shall do in the present state, and the current step that goes with it."""
    memory, rules = f.memory, f.rules
    if memory.state not in ENERGISED:
        return STANDBY, None
    if not rules.manual:
        return Setpoint(run=True), None
    mode, precharge = SETPOINTS[memory.state]
    if memory.state is State.CHARGING:
        chosen, memory.raise_s = limits.choose(f, faults[0] if faults else None)
    else:
        chosen, memory.raise_s = Step(0, rules.steps_a[0], PRECHARGE), None
    if memory.step is not None and memory.session is not None and chosen.index != memory.step.index:
        memory.session = replace(memory.session, step_changes=memory.session.step_changes + 1)
        if chosen.index < memory.step.index:
            memory.row_returns = counted(memory.row_returns, chosen.key)
        memory.confirmed, memory.taper_s = False, None  # it is told another one, and another current follows
    memory.step = chosen
    return Setpoint(run=True, current_limit=chosen.index, charge_mode=mode, precharge=precharge), chosen


def _order(f: Facts, setpoint: Setpoint, faults: tuple[ActiveFault, ...]) -> Command | None:
    """The standing order: a stop, the next value of the setpoint, or nothing.

    A fault that stops and is new orders a stop in every state, also where the charger was just seen to stand by.
    """
    memory = f.memory
    if memory.state in ENERGISED:
        return next_order(f, setpoint)
    news = any(fault.since_s == f.now_s and fault.effect >= Effect.STOP for fault in faults)
    return STOP if news or must_stop(f, memory.state) else None
