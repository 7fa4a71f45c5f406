"""Where a bay goes next: one trigger at most, and why. The machine's table says where it leads.

Each kind of state has one function here; all of them ask the same questions in the same order: must current stop, can
the charger be trusted to stand by, does something keep us from charging, does the battery want to be charged.
"""

from dataclasses import replace

from orchestrator.core.facts import Facts
from orchestrator.core.faults import ROW, Clear
from orchestrator.core.finish import finished, full_due, goes_full, goes_on, target
from orchestrator.core.machine import RESTING, Trigger
from orchestrator.core.operator import RESET
from orchestrator.core.outofcontrol import out_of_control, problem
from orchestrator.core.safestop import LOST_S, gives_up, verified
from orchestrator.core.witnesses.standby import current_without_order
from orchestrator.model import ENERGISED, ActiveFault, Cause, Effect, State

Course = tuple[Trigger | None, Cause]
Faults = tuple[ActiveFault, ...]

#: Everything must have spoken for a charge for this long, with a second, newer sample of each value.
QUALIFY_S = 2.0
#: A stage's voltage must have been reached for this long before the next stage begins.
REACHED_S = 2.0
#: A battery that is to be charged all the way once in so many days, and has this much, is as good as full.
FULL_DUE_PCT = 98.0
#: A full battery must have lost this much before it is charged again, however high the policy's threshold.
RECHARGE_DROP_PCT = 3.0

#: Where each trigger of rest leads; to be there already is no trigger.
LEADS = {
    Trigger.LOSE: State.OFFLINE,
    Trigger.REST: State.IDLE,
    Trigger.HOLD: State.HELD,
    Trigger.SUSPEND: State.SUSPENDED,
    Trigger.FILL: State.FULL,
    Trigger.TRIP: State.TRIPPED,
}


def course(f: Facts, faults: Faults) -> Course:
    """The trigger for now (None: stay) and why the bay is, or goes, where it is."""
    state = f.memory.state
    if state in ENERGISED:
        return _energised(f, faults)
    if state in RESTING or state is State.TRIPPED:
        return _resting(f, faults)
    return _stopping(f, faults)


def _energised(f: Facts, faults: Faults) -> Course:
    if faults and faults[0].effect >= Effect.PAUSE:
        return Trigger.STOP, faults[0].cause
    asked = f.memory.hold or _ending(f) or (Cause("operator_pause") if f.memory.paused else None)
    if asked is not None:
        return Trigger.STOP, asked
    if f.memory.state is State.CHARGING:
        full = finished(f)
        if full is not None:
            f.memory.full_pct = f.soc
            if goes_full(f) or (f.memory.session is not None and f.memory.session.full):
                f.memory.full_s = f.now_s
            return Trigger.STOP, Cause.of("full", key=full.key, place=full.place, what=full)
        return None, _charging(f, faults)
    return _precharging(f)


def _ending(f: Facts) -> Cause | None:
    return Cause.of("service_ends", why=f.snapshot.ending) if f.snapshot.ending else None


def _charging(f: Facts, faults: Faults) -> Cause:
    chosen, rises = f.memory.step, None
    if chosen is None:
        return Cause("charges_by_itself") if not f.rules.manual else f.memory.cause
    limited = faults[0].cause if faults and faults[0].effect >= Effect.LIMIT else None
    if f.memory.raise_s is not None:
        rises = f.rules.by_policy("rises", "current.raise_after_s", hold_s=f.rules.policy.current.raise_after_s)
    return Cause.of(
        "charging", key=chosen.rule.key, place=chosen.rule.place,
        step=chosen.number, step_a=chosen.current_a, rule=chosen.rule, limited=limited, rises=rises, held=_holds(f),
    )  # fmt: skip


def _holds(f: Facts) -> Cause | None:
    """A full pack stays on, to balance: for how long still."""
    session, finish = f.memory.session, f.rules.policy.finish
    if session is None or not session.full:
        return None
    left_min = max(finish.hold_min - session.held_s / 60, 0.0)
    return f.rules.by_policy("held_at_the_top", "finish.hold_min", left_min=left_min)


def _precharging(f: Facts) -> Course:
    memory, rule, by_policy = f.memory, f.rules.policy.precharge, f.rules.by_policy
    session = memory.session
    if rule is None or session is None or f.pack_v is None:  # unknown means no, whoever lets it come to this
        return Trigger.STOP, Cause("precharge_impossible")
    pulse = memory.state is State.PRECHARGE_PULSE
    target_v = rule.pulse.until_v if pulse else rule.below_v
    if f.pack_v < target_v:
        memory.reached_s = None
    elif memory.reached_s is None:
        memory.reached_s = f.now_s
    reached = memory.reached_s is not None and f.now_s - memory.reached_s >= REACHED_S
    if session.rise_s >= rule.rise.within_min * 60:  # it rose: the fault table has looked already
        memory.session = replace(session, rise_s=0.0, rise_v=f.pack_v)
    if pulse and reached:
        return Trigger.CONTINUE, by_policy("pack_reached", "precharge.pulse.until_v", target_v=target_v)
    if pulse and session.pulse_s >= rule.pulse.max_min * 60:
        return Trigger.CONTINUE, by_policy("pulses_over", "precharge.pulse.max_min", limit_min=rule.pulse.max_min)
    if reached:
        return Trigger.CHARGE, by_policy("pack_reached", "precharge.below_v", target_v=target_v)
    stage = "pulse" if pulse else "continuous"
    return None, by_policy(f"precharging_{stage}", f"precharge.{stage}", below_v=rule.below_v)


def _stopping(f: Facts, faults: Faults) -> Course:
    state, memory = f.memory.state, f.memory
    if verified(f):
        return _rest(f, faults)
    if gives_up(f):
        return Trigger.GIVE_UP, out_of_control(f)
    if state is State.UNCONTROLLABLE:
        return None, out_of_control(f)
    if state is State.STARTING and not memory.unverified and not f.charger.online and f.state_s >= LOST_S:
        return Trigger.LOSE, _offline(f)
    return None, memory.cause


def _offline(f: Facts) -> Cause:
    return problem(f, "charger_offline")


def _resting(f: Facts, faults: Faults) -> Course:
    fresh = next((x for x in faults if x.since_s == f.now_s and x.effect >= Effect.STOP), None)
    if fresh is not None and f.charger.online:
        return Trigger.STOP, fresh.cause
    if f.runs:
        return Trigger.STOP, Cause("runs_uncommanded")
    if f.unordered:
        return Trigger.STOP, current_without_order(f) or f.memory.cause
    if f.memory.state is State.OFFLINE and not f.stopped:
        answers = f.charger.online and f.reading is not None
        return None, Cause("stopped_first") if answers else _offline(f)
    return _rest(f, faults)


def _rest(f: Facts, faults: Faults) -> Course:
    """Where a bay whose charger stands by belongs."""
    trigger, why = _resting_place(f, faults)
    state = f.memory.state
    if state is State.TRIPPED:
        if trigger is Trigger.TRIP:
            return None, why
        return Trigger.RESET, _held(f, RESET)
    if state is State.QUALIFYING and trigger is Trigger.QUALIFY:
        return _qualifying(f)
    if trigger is Trigger.QUALIFY and state not in (State.IDLE, State.HELD, State.FULL, State.SUSPENDED):
        return (Trigger.REST if f.memory.session is None else Trigger.SUSPEND), why
    return (None if LEADS.get(trigger) is state else trigger), why


def _resting_place(f: Facts, faults: Faults) -> tuple[Trigger, Cause]:
    memory = f.memory
    worst = faults[0] if faults else None
    lost = not f.charger.online or f.reading is None
    if worst is not None and worst.effect is Effect.TRIP and (memory.state is State.TRIPPED or not lost):
        return Trigger.TRIP, worst.told
    if lost:  # a trip promises a stop that was verified: first the line
        return Trigger.LOSE, _offline(f)
    waits = next((x for x in faults if ROW[x.id].clear is Clear.OPERATOR), None)
    if waits is not None:
        return Trigger.HOLD, waits.told
    if memory.hold is not None:
        return Trigger.HOLD, _held(f, memory.hold)
    ending = _ending(f)
    if ending is not None:  # the charge goes on after it
        return (Trigger.REST if memory.session is None else Trigger.SUSPEND), ending
    if memory.paused:
        return Trigger.SUSPEND, Cause("operator_pause", advice="start")
    absent = _absent(f)
    if absent is not None:
        return absent
    wanted, why = _wanted(f)
    if memory.full_pct is not None and not wanted:
        return Trigger.FILL, why
    if f.soc is not None and not wanted:
        return Trigger.REST, why
    if worst is not None and worst.effect >= Effect.NO_START:
        return Trigger.SUSPEND, worst.told
    return (Trigger.QUALIFY if wanted else Trigger.REST), why


def _held(f: Facts, hold: Cause) -> Cause:
    """Why a person must start, and how."""
    return hold.with_(then=Cause.of("to_go_on", how=_start(f)))


def _start(f: Facts) -> Cause:
    return Cause.of("start_bay", bay=f.rules.bay.name)


def _absent(f: Facts) -> tuple[Trigger, Cause] | None:
    """Where a bay without a battery belongs, None when a battery is there."""
    if f.battery.online and not f.silent:
        return None
    if not f.departed:
        id_ = "bmu_just_booted" if f.just_booted else "bmu_does_not_answer"
        what = Cause.of(id_, node_id=f.rules.bay.battery.node_id)
        if f.battery.problem:
            what = Cause.of("bmu_problem", problem=f.battery.problem)
        return Trigger.LOSE, Cause.of("battery_not_heard", charger_v=f.volts or 0.0, what=what)
    return Trigger.REST, Cause("battery_absent")


def _wanted(f: Facts) -> tuple[bool, Cause]:
    """Whether the battery wants to be charged, and why (not)."""
    policy, full_pct = f.rules.policy, f.memory.full_pct
    if f.soc is None:
        return False, Cause("soc_unknown")
    if full_pct is None and f.memory.session is not None:  # what was interrupted is brought to its end
        if unfinished := goes_on(f):
            return True, unfinished
        threshold, key = target(f)
    elif full_pct is None:
        key, threshold = "start.soc_below_pct", policy.start.soc_below_pct
    elif full_due(f):  # it is full by its target only
        key, threshold = "finish.full_every_days", FULL_DUE_PCT
    else:  # it may have been full by taper at less than the policy's SOC: it must have fallen since
        key, threshold = "recharge.soc_below_pct", min(policy.recharge.soc_below_pct, full_pct - RECHARGE_DROP_PCT)
    below = f.soc < threshold
    id_ = "soc_below" if below else "soc_not_below"
    return below, f.rules.by_policy(id_, key, soc_pct=f.soc, threshold_pct=threshold)


def _qualifying(f: Facts) -> Course:
    memory = f.memory
    not_yet = Cause.of("waits_for_values", missing=f.missing) if not f.present else None
    if not f.connected:
        not_yet = not_yet or Cause("waits_for_contactor")
    if not_yet is not None:
        memory.qualified_s, memory.ready, memory.intends = None, False, False
        return None, not_yet
    if memory.qualified_s is None:
        memory.qualified_s = f.now_s
    if f.now_s - memory.qualified_s < QUALIFY_S or not _seen_twice(f, memory.qualified_s) or not f.stopped:
        return None, Cause("checking")
    memory.ready = True
    if f.snapshot.waits is not None:
        memory.intends = False
        return None, f.snapshot.waits
    memory.intends = True
    if not f.snapshot.running_kept:
        return None, Cause("writing_down")
    rule = f.rules.policy.precharge
    if f.rules.manual and rule is not None and f.pack_v is not None and f.pack_v < rule.below_v:
        below = f.rules.by_policy("needs_pulses", "precharge.below_v", pack_v=f.pack_v, below_v=rule.below_v)
        return Trigger.PULSE, below
    return Trigger.CHARGE, Cause.of("qualified", pack_v=f.pack_v, soc_pct=f.soc, pack_c=f.temperature_c)


def _seen_twice(f: Facts, since_s: float) -> bool:
    """A newer sample of every value has come since; the first one was there when it began."""
    battery = f.snapshot.battery
    values = (battery.voltage_v, battery.temperature_c, battery.status, battery.soc_pct, battery.soh_pct)
    return all(value is not None and value.t_s > since_s for value in values)
