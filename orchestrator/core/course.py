"""Where a bay goes next: one trigger at most, and the reason that people read. The machine's table says where it leads.

Each kind of state has one function here; all of them ask the same questions in the same order: must current stop, can
the charger be trusted to stand by, does something keep us from charging, does the battery want to be charged.
"""

from dataclasses import replace

from orchestrator.core import latches
from orchestrator.core.facts import Facts
from orchestrator.core.faults import ROW, Clear
from orchestrator.core.finish import finished
from orchestrator.core.machine import RESTING, Trigger
from orchestrator.core.safestop import LASTS_S, LOST_S, gives_up, verified
from orchestrator.core.witnesses.standby import current_without_order, sees_current
from orchestrator.model import ENERGISED, ActiveFault, Cause, Effect, State

Course = tuple[Trigger | None, Cause | str]
Faults = tuple[ActiveFault, ...]

#: Everything must have spoken for a charge for this long, with a second, newer sample of each value.
QUALIFY_S = 2.0
#: A stage's voltage must have been reached for this long before the next stage begins.
REACHED_S = 2.0
#: A full battery must have lost this much before it is charged again, however high the policy's threshold.
RECHARGE_DROP_PCT = 3.0

#: Where each trigger of rest leads; to be there already is no trigger.
LEADS = {
    Trigger.LOSE: State.OFFLINE,
    Trigger.REST: State.IDLE,
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
            return Trigger.STOP, f"full: {full}"
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
        step=chosen.index, step_a=chosen.current_a, rule=chosen.rule, limited=limited, rises=rises,
    )  # fmt: skip


def _precharging(f: Facts) -> Course:
    memory, rule, source = f.memory, f.rules.policy.precharge, f.rules.policy.source
    session = memory.session
    if rule is None or session is None or f.pack_v is None:  # unknown means no, whoever lets it come to this
        return Trigger.STOP, "precharge without a rule for it, or without the pack's voltage"
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
        return Trigger.CONTINUE, f"the pack reached {target_v:g} V ({source.at('precharge.pulse.until_v')})"
    if pulse and session.pulse_s >= rule.pulse.max_min * 60:
        return Trigger.CONTINUE, f"{rule.pulse.max_min:g} min of pulses ({source.at('precharge.pulse.max_min')})"
    if reached:
        return Trigger.CHARGE, f"the pack reached {target_v:g} V ({source.at('precharge.below_v')})"
    where = source.at("precharge.pulse" if pulse else "precharge.continuous")
    return None, f"the pack is below {rule.below_v:g} V: {'pulse' if pulse else 'continuous'} precharge ({where})"


def _stopping(f: Facts, faults: Faults) -> Course:
    state, memory = f.memory.state, f.memory
    if verified(f):
        return _rest(f, faults)
    if gives_up(f):
        return Trigger.GIVE_UP, _out_of_control(f)
    if state is State.UNCONTROLLABLE:
        return None, _out_of_control(f)
    if state is State.STARTING and not memory.unverified and not f.charger.online and f.state_s >= LOST_S:
        return Trigger.LOSE, _offline_reason(f)
    return None, memory.cause


def _out_of_control(f: Facts) -> str:
    """First what to do, then why."""
    memory, do = f.memory, f"CUT THE MAINS of this charger ({f.rules.bay.charger.port})"
    if f.stopped:
        lasts_s = f.now_s - memory.witnessed.proof[0]
        return f"{do} unless it stays off: it has stood by for {lasts_s:.0f} s, {LASTS_S:g} s are believed"
    if f.charger.online and f.reading is not None and not f.runs and sees_current(f):
        return (  # a BMU with an offset, or one that stands still, looks the same as a charger that lies
            f"{do}: it says {f.reading.current_a:.2f} A, the BMU still sees {f.pack_a:.1f} A; one of them is wrong. "
            "If the BMU shows it with the mains off too, restart the BMU"
        )
    since_s = memory.stopping_s if memory.stopping_s is not None else f.now_s - f.state_s
    return f"{do} now: it has not obeyed the stop for {f.now_s - since_s:.0f} s: {_why(f)}"


def _why(f: Facts) -> str:
    """What each witness says, the old marked as old."""
    sees = f"; the BMU sees {f.pack_a:.1f} A" if f.pack_a is not None else "; the BMU is not heard"
    if f.charger.problem or not f.charger.online or f.reading is None:
        heard = f.snapshot.charger
        last = f"; {heard.current_a:.2f} A, last heard {f.now_s - heard.t_s:.0f} s ago" if heard is not None else ""
        return (f.charger.problem or f"no answer on {f.rules.bay.charger.port}") + last + sees
    if f.runs:
        return f"it delivers {f.reading.current_a:.2f} A{sees}"
    return f"its status does not show a standby that lasts{sees}"


def _offline_reason(f: Facts) -> str:
    return f.charger.problem or f"the charger on {f.rules.bay.charger.port} does not answer"


def _resting(f: Facts, faults: Faults) -> Course:
    fresh = next((x for x in faults if x.since_s == f.now_s and x.effect >= Effect.STOP), None)
    if fresh is not None and f.charger.online:
        return Trigger.STOP, fresh.cause
    if f.runs:
        return Trigger.STOP, "the charger runs though it was not commanded to"
    if f.unordered:
        return Trigger.STOP, current_without_order(f) or f.memory.cause
    if f.memory.state is State.OFFLINE and not f.stopped:
        answers = f.charger.online and f.reading is not None
        return None, "the charger is being stopped before anything else" if answers else _offline_reason(f)
    return _rest(f, faults)


def _rest(f: Facts, faults: Faults) -> Course:
    """Where a bay whose charger stands by belongs."""
    trigger, reason = _resting_place(f, faults)
    state = f.memory.state
    if state is State.TRIPPED:
        if trigger is Trigger.TRIP:
            return None, reason
        return Trigger.RESET, "reset by the operator"
    if state is State.QUALIFYING and trigger is Trigger.QUALIFY:
        return _qualifying(f)
    if trigger is Trigger.QUALIFY and state not in (State.IDLE, State.FULL, State.SUSPENDED):
        return (Trigger.REST if f.memory.session is None else Trigger.SUSPEND), reason
    return (None if LEADS.get(trigger) is state else trigger), reason


def _resting_place(f: Facts, faults: Faults) -> tuple[Trigger, Cause | str]:
    memory = f.memory
    worst = faults[0] if faults else None
    lost = not f.charger.online or f.reading is None
    if worst is not None and worst.effect is Effect.TRIP and (memory.state is State.TRIPPED or not lost):
        return Trigger.TRIP, _then(worst.cause, latches.goes_on(f))
    if lost:  # a trip promises a stop that was verified: first the line
        return Trigger.LOSE, _offline_reason(f)
    waits = next((x for x in faults if ROW[x.id].clear is Clear.OPERATOR), None)
    if waits is not None:
        return Trigger.REST, waits.cause
    if memory.hold:
        return Trigger.REST, memory.hold
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
        return Trigger.SUSPEND, _then(worst.cause, latches.goes_on(f))
    return (Trigger.QUALIFY if wanted else Trigger.REST), why


def _then(cause: Cause, then: Cause | None) -> Cause:
    return cause.with_(then=then) if then is not None else cause


def _absent(f: Facts) -> tuple[Trigger, str] | None:
    """Where a bay without a battery belongs, None when a battery is there."""
    if f.battery.online and not f.silent:
        return None
    if not f.departed:
        does_not = "has just booted" if f.just_booted else "does not answer"
        problem = f.battery.problem or f"the BMU (node 0x{f.rules.bay.battery.node_id:02X}) {does_not}"
        return Trigger.LOSE, f"{f.volts or 0:.1f} V at the charger, but {problem}"
    return Trigger.REST, "no battery"


def _wanted(f: Facts) -> tuple[bool, str]:
    """Whether the battery wants to be charged, and why (not)."""
    policy, full_pct = f.rules.policy, f.memory.full_pct
    if f.soc is None:
        return False, "a battery is there; its SOC is not known yet"
    if full_pct is None and f.memory.session is not None:  # what was interrupted is brought to its end
        key, threshold = "finish.soc_pct", policy.finish.soc_pct
    elif full_pct is None:
        key, threshold = "start.soc_below_pct", policy.start.soc_below_pct
    else:  # it may have been full by taper at less than the policy's SOC: it must have fallen since
        key, threshold = "recharge.soc_below_pct", min(policy.recharge.soc_below_pct, full_pct - RECHARGE_DROP_PCT)
    below = f.soc < threshold
    at = policy.source.at(key)
    return below, f"SOC {f.soc:.0f} % is {'' if below else 'not '}below {threshold:g} % ({at})"


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
        return None, "checking charger and battery before a charge"
    memory.ready = True
    if f.snapshot.waits is not None:
        memory.intends = False
        return None, f.snapshot.waits
    memory.intends = True
    if not f.snapshot.running_kept:
        return None, "writing down that a charge begins, so that a restart would know of it"
    rule = f.rules.policy.precharge
    if f.rules.manual and rule is not None and f.pack_v is not None and f.pack_v < rule.below_v:
        at = f.rules.policy.source.at("precharge.below_v")
        return Trigger.PULSE, f"the pack has {f.pack_v:.2f} V, below {rule.below_v:g} V ({at})"
    return Trigger.CHARGE, f"qualified: {f.pack_v:.2f} V, SOC {f.soc:.0f} %, {f.temperature_c:.1f} °C"


def _seen_twice(f: Facts, since_s: float) -> bool:
    """A newer sample of every value has come since; the first one was there when it began."""
    battery = f.snapshot.battery
    values = (battery.voltage_v, battery.temperature_c, battery.status, battery.soc_pct, battery.soh_pct)
    return all(value is not None and value.t_s > since_s for value in values)
