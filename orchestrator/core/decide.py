"""`decide()` makes one decision about one bay, for the live service, the simulator, the checker and the replay alike.

facts → history → the operator's request → faults → trigger, if any → state → setpoint → command.
"""

from orchestrator.core import latches, limits, rows
from orchestrator.core.active import active_faults
from orchestrator.core.alarm import alarm
from orchestrator.core.checks.ourselves import OVERRUN_S
from orchestrator.core.contactor import closes
from orchestrator.core.facts import Facts
from orchestrator.core.history import charger, entered, session, update_history
from orchestrator.core.history import stage as stages
from orchestrator.core.machine import fire
from orchestrator.core.memory import Memory, Sequence
from orchestrator.core.next_transition import next_transition
from orchestrator.core.operator import handle_request, held_back, over
from orchestrator.core.parts import changed, made
from orchestrator.core.rules import Rules
from orchestrator.core.safestop import must_stop, stands_by
from orchestrator.core.sequence import next_command
from orchestrator.core.shared import shared
from orchestrator.core.states import ALIKE, ENERGISED, SESSION_ENDS
from orchestrator.model import (
    STANDBY,
    STOP,
    ActiveFault,
    Cause,
    ChargeMode,
    Command,
    CurrentStep,
    Decision,
    Effect,
    Precharge,
    Request,
    Session,
    Setpoint,
    Snapshot,
    State,
)

#: The setpoint in each state in which current flows; in CHARGING the current step comes from the policy.
SETPOINTS: dict[State, tuple[ChargeMode, Precharge]] = {
    State.PRECHARGE_PULSE: (ChargeMode.PRECHARGE, Precharge.PULSE),
    State.PRECHARGE_CONTINUOUS: (ChargeMode.PRECHARGE, Precharge.CONTINUOUS),
    State.CHARGING: (ChargeMode.CHARGE, Precharge.OFF),
}
PRECHARGE = Cause("precharge_step", key="precharge")
#: In automatic mode the charger chooses its own values.
BY_ITSELF = Setpoint(run=True)


def decide(now_s: float, snapshot: Snapshot, memory: Memory, rules: Rules) -> tuple[Decision, Memory]:
    """What to do now, and what to remember.

    `now_s` is monotonic and never goes back between two calls. `memory` is what the previous call returned (`Memory()`
    for the first). The result depends on nothing else, so the same arguments always give the same result.
    """
    if memory.since_s is None:
        memory = changed(memory, since_s=now_s)
    if snapshot.late_s > OVERRUN_S:
        memory = changed(memory, stalled_s=now_s)
    f = Facts.of(now_s, snapshot, memory, rules)
    f = update_history(f, now_s - memory.last_s if memory.last_s is not None else 0.0)
    f, refusal = _requested(f, snapshot)
    known = latches.update(f)
    if known is not f.memory.faults:
        f = f.with_memory(changed(f.memory, faults=known))
    faults = active_faults(f.memory, now_s, rules.bay.name, f, at_rest=stands_by(f)) if known else ()
    f, cause, ended = _move(f, faults)
    f, setpoint, chosen = _setpoint(f, faults)
    command, sequence = _command(f, setpoint, faults)
    closed = closes(f.memory.state, closed=f.memory.closed, standby=f.standby)
    memory = changed(f.memory, cause=cause, sequence=sequence, closed=closed, looked_s=now_s, last_s=now_s)
    decision = made(
        Decision, memory.state, cause, command, setpoint, chosen, faults, alarm(memory, faults), closed,
        ended or memory.session, refusal,
    )  # fmt: skip
    return decision, memory


def _requested(f: Facts, snapshot: Snapshot) -> tuple[Facts, Cause | None]:
    """Carry out the request; returns why it was refused, if it was."""
    request, refusal = snapshot.request, None
    if request is not None:
        heard = handle_request(
            f.memory, request, f.now_s, snapshot.not_persisted, f.rules.bay.name,
            at_rest=stands_by(f), by=snapshot.asked_by, target_pct=snapshot.target_pct, soc_pct=f.soc,
        )  # fmt: skip
        refusal = heard.refusal
        f = f.with_memory(changed(f.memory, operator=heard.operator, faults=heard.faults))
    if f.memory.operator.target_pct is not None and (f.battery_removed or f.memory.battery.another):
        f = f.with_memory(changed(f.memory, operator=over(f.memory.operator)))
    if (hold := shared(f.charger)) is not None:
        f = f.with_memory(changed(f.memory, operator=held_back(f.memory.operator, hold)))
        refusal = hold if request is Request.START else refusal
    return f, refusal


def _move(f: Facts, faults: tuple[ActiveFault, ...]) -> tuple[Facts, Cause, Session | None]:
    """Move to the state that the facts call for; returns the cause and the session that this ended, if any."""
    before = f.memory.state
    trigger, cause, changes = next_transition(f, faults)
    if changes:
        f = f.with_memory(changed(f.memory, **changes))
    state = fire(before, trigger) if trigger is not None else before
    if state is not before:
        f = f.with_memory(entered(f, state, cause))
    memory = f.memory
    if memory.session is None or not _is_over(f, before):
        return f, cause, None
    held = memory.operator.hold if memory.state is State.HELD else None  # without the advice added to it
    result = (memory.stop.stop_cause if before is State.STOPPING else held) or cause
    return (
        f.with_memory(changed(memory, session=None, operator=over(memory.operator))),
        cause,
        session.ended(memory.session, result),
    )


def _is_over(f: Facts, before: State) -> bool:
    """Whether the open charge has ended. One left open by the previous run of the service ends with its battery.

    Moving between IDLE and HELD is no progress: a charge left open by a restart stays open.
    """
    after = f.memory.state
    if after not in SESSION_ENDS:
        return False
    exchanged = f.memory.faults.get("battery_exchanged")
    another = f.battery_removed or (exchanged is not None and exchanged.raised_s is not None)
    goes_on = after is before or before is State.STARTING or {before, after} == ALIKE
    return another or not goes_on


def _setpoint(f: Facts, faults: tuple[ActiveFault, ...]) -> tuple[Facts, Setpoint, CurrentStep | None]:
    """The setpoint for the present state, and the current step that goes with it."""
    memory, rules = f.memory, f.rules
    if memory.state not in ENERGISED:
        return f, STANDBY, None
    if not rules.manual:
        return f, BY_ITSELF, None
    before = memory.stage.step
    if memory.state is State.CHARGING:
        chosen, raise_s = limits.choose(f, faults[0] if faults else None)
    else:
        chosen, raise_s = CurrentStep(0, rules.steps_a[0], PRECHARGE), None
    anew = before is not None and memory.session is not None and chosen.index != before.index
    stage = stages.chosen(memory.stage, chosen, raise_s, anew=anew)
    if stage is not memory.stage:
        f = f.with_memory(changed(memory, stage=stage))
    if anew:
        lower = before is not None and chosen.index < before.index
        f = f.with_memory(
            changed(
                f.memory,
                session=session.step_changed(memory.session),
                charger=charger.told_anew(memory.charger),
                tables=rows.lowered(memory.tables, chosen.key) if lower else memory.tables,
            )
        )
    mode, precharge = SETPOINTS[memory.state]
    return f, Setpoint(run=True, current_step=chosen.index, charge_mode=mode, precharge=precharge), chosen


def _command(f: Facts, setpoint: Setpoint, faults: tuple[ActiveFault, ...]) -> tuple[Command | None, Sequence]:
    """The standing command: a stop, the next value of the setpoint, or nothing.

    A new fault with a STOP effect or worse commands a stop in every state, even if the charger was just seen in
    standby.
    """
    memory = f.memory
    if memory.state in ENERGISED:
        return next_command(f, setpoint)
    news = [fault for fault in faults if fault.since_s == f.now_s and fault.effect >= Effect.STOP]
    return (STOP if news or must_stop(f, memory.state) else None), memory.sequence
