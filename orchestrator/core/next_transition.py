"""Chooses where a bay goes next: at most one trigger, and its cause. The machine's table says where it leads.

Each kind of state has one function here. All ask the same questions in the same order: must current stop, is standby
proved, does anything prevent a charge, does the battery want one.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from orchestrator.core.facts import ANSWER_S, Facts
from orchestrator.core.finish import finished, goes_full
from orchestrator.core.history import battery, stage
from orchestrator.core.history import session as sessions
from orchestrator.core.machine import Trigger
from orchestrator.core.operator import RESET, over, pause
from orchestrator.core.outofcontrol import out_of_control
from orchestrator.core.resting import absent, ending, held, offline, resting_place, unsupplied
from orchestrator.core.safestop import LOST_S, gives_up, verified
from orchestrator.core.states import ENERGISED, SETTLED, STARTABLE
from orchestrator.core.witnesses.standby import current_without_order
from orchestrator.model import ActiveFault, Cause, Effect, State

Faults = tuple[ActiveFault, ...]


class Next(NamedTuple):
    """Where a bay goes next."""

    trigger: Trigger | None  #: None: it stays
    cause: Cause  #: why it stays where it is, or goes there
    changes: Mapping[str, Any] = {}  #: the parts of the memory that change with it


#: Every condition for a charge must have held for this long, with a second, newer sample of each value.
QUALIFY_S = 2.0
#: The pack must have been at a stage's voltage for this long before the next stage begins.
REACHED_S = 2.0
#: Where each trigger of rest leads; if the bay is there already, there is no trigger.
LEADS = {
    Trigger.LOSE: State.OFFLINE,
    Trigger.REST: State.IDLE,
    Trigger.HOLD: State.HELD,
    Trigger.SUSPEND: State.SUSPENDED,
    Trigger.FILL: State.FULL,
    Trigger.TRIP: State.TRIPPED,
}


def next_transition(f: Facts, faults: Faults) -> Next:
    """The trigger for now (None: stay), and why the bay is, or goes, where it is."""
    state = f.memory.state
    if state in ENERGISED:
        return _energised(f, faults)
    if state in SETTLED:
        return _resting(f, faults)
    return _stopping(f, faults)


def _energised(f: Facts, faults: Faults) -> Next:
    if faults and faults[0].effect >= Effect.PAUSE:
        return Next(Trigger.STOP, faults[0].cause)
    asked = f.memory.operator.hold or ending(f) or pause(f.memory.operator)
    if asked is not None:
        return Next(Trigger.STOP, asked)
    if (waits := unsupplied(f)) is not None:
        return Next(Trigger.STOP, waits[1])
    if f.memory.state is State.CHARGING:
        full = finished(f)
        if full is not None:
            session = f.memory.session
            known = battery.charged_full(f, all_the_way=goes_full(f) or bool(session is not None and session.full))
            cause = Cause.of("full", key=full.key, place=full.place, what=full)
            return Next(Trigger.STOP, cause, {"battery": known, "operator": over(f.memory.operator)})
        return Next(None, _charging(f, faults))
    return _precharging(f)


def _charging(f: Facts, faults: Faults) -> Cause:
    chosen, rises = f.memory.stage.step, None
    if chosen is None:
        return Cause("charges_by_itself") if not f.rules.manual else f.memory.cause
    limited = faults[0].cause if faults and faults[0].effect >= Effect.LIMIT else None
    if f.memory.stage.raise_s is not None:
        rises = f.rules.by_policy("rises", "current.raise_after_s", hold_s=f.rules.policy.current.raise_after_s)
    return Cause.of(
        "charging", key=chosen.rule.key, place=chosen.rule.place,
        step=chosen.number, step_a=chosen.current_a, rule=chosen.rule, limited=limited, rises=rises, held=_holds(f),
    )  # fmt: skip


def _holds(f: Facts) -> Cause | None:
    """How much longer a full pack stays on charge to balance."""
    session, finish = f.memory.session, f.rules.policy.finish
    if session is None or not session.full:
        return None
    left_min = max(finish.hold_min - session.held_s / 60, 0.0)
    return f.rules.by_policy("held_at_the_top", "finish.hold_min", left_min=left_min)


def _precharging(f: Facts) -> Next:
    memory, rule, by_policy = f.memory, f.rules.policy.precharge, f.rules.by_policy
    session = memory.session
    if rule is None or session is None or f.pack_v is None:  # unknown means no, whatever the caller assumed
        return Next(Trigger.STOP, Cause("precharge_impossible"))
    pulse = memory.state is State.PRECHARGE_PULSE
    target_v = rule.pulse.until_v if pulse else rule.below_v
    now = stage.reaches(f, memory.stage, holds=f.pack_v >= target_v)
    if session.rise_s >= rule.rise.within_min * 60:  # it rose: the fault table has already checked that
        session = sessions.rise_counts(f, session)
    changes = {"stage": now, "session": session}
    reached = now.reached_s is not None and f.now_s - now.reached_s >= REACHED_S
    if pulse and reached:
        why = by_policy("pack_reached", "precharge.pulse.until_v", target_v=target_v)
        return Next(Trigger.CONTINUE, why, changes)
    if pulse and session.pulse_s >= rule.pulse.max_min * 60:
        why = by_policy("pulses_over", "precharge.pulse.max_min", limit_min=rule.pulse.max_min)
        return Next(Trigger.CONTINUE, why, changes)
    if reached:
        why = by_policy("pack_reached", "precharge.below_v", target_v=target_v)
        return Next(Trigger.CHARGE, why, changes)
    kind = "pulse" if pulse else "continuous"
    return Next(None, by_policy(f"precharging_{kind}", f"precharge.{kind}", below_v=rule.below_v), changes)


def _stopping(f: Facts, faults: Faults) -> Next:
    state, memory = f.memory.state, f.memory
    if verified(f):
        if f.unheard and f.state_s < ANSWER_S:
            return Next(None, memory.cause)
        return _rest(f, faults)
    if gives_up(f):
        return Next(Trigger.GIVE_UP, out_of_control(f))
    if state is State.UNCONTROLLABLE:
        return Next(None, out_of_control(f))
    if state is State.STARTING and not memory.stop.unverified and not f.charger.online and f.state_s >= LOST_S:
        return Next(Trigger.LOSE, offline(f))
    return Next(None, memory.cause)


def _resting(f: Facts, faults: Faults) -> Next:
    fresh = next((x for x in faults if x.since_s == f.now_s and x.effect >= Effect.STOP), None)
    if fresh is not None and (f.charger.online or f.stalled):
        return Next(Trigger.STOP, fresh.cause)
    if f.runs:
        return Next(Trigger.STOP, Cause("runs_uncommanded"))
    if f.unordered:
        return Next(Trigger.STOP, current_without_order(f) or f.memory.cause)
    if f.memory.state is State.OFFLINE and not f.stopped:
        return Next(None, _stopped_first(f))
    if f.unheard and f.memory.state is not State.OFFLINE:
        return Next(None, f.memory.cause)
    return _rest(f, faults)


def _stopped_first(f: Facts) -> Cause:
    """Why a bay waits that has lost a device: until its charger is proved to stand by, whatever it was before."""
    if not f.charger.online or f.reading is None:
        return offline(f)
    without = absent(f)
    return Cause.of("stopped_again", what=without[1]) if without is not None else Cause("stopped_first")


def _rest(f: Facts, faults: Faults) -> Next:
    """Where a bay belongs whose charger is in standby."""
    trigger, why = resting_place(f, faults)
    state = f.memory.state
    if state is State.TRIPPED:
        if trigger is Trigger.TRIP:
            return Next(None, why)
        return Next(Trigger.RESET, held(f, f.memory.operator.hold or RESET))
    if state is State.QUALIFYING and trigger is Trigger.QUALIFY:
        return _qualifying(f)
    if trigger is Trigger.QUALIFY and state not in STARTABLE:
        return Next((Trigger.REST if f.memory.session is None else Trigger.SUSPEND), why)
    return Next((None if LEADS.get(trigger) is state else trigger), why)


def _qualifying(f: Facts) -> Next:
    known = f.memory.stage
    not_yet = Cause.of("waits_for_values", missing=f.missing) if not f.present else None
    if not f.connected:
        not_yet = not_yet or Cause("waits_for_contactor")
    if not_yet is not None:
        return Next(None, not_yet, {"stage": stage.not_qualified(known)})
    known = stage.qualifies(f, known)
    if not _qualified(f, known.qualified_s):
        return Next(None, Cause("checking"), {"stage": known})
    waits = f.snapshot.waits
    changes = {"stage": stage.is_ready(known, intends=waits is None)}
    if waits is not None:
        return Next(None, waits, changes)
    if not f.snapshot.running_persisted:
        return Next(None, Cause("writing_down"), changes)
    rule = f.rules.policy.precharge
    if f.rules.manual and rule is not None and f.pack_v is not None and f.pack_v < rule.below_v:
        below = f.rules.by_policy("needs_pulses", "precharge.below_v", pack_v=f.pack_v, below_v=rule.below_v)
        return Next(Trigger.PULSE, below, changes)
    why = Cause.of("qualified", pack_v=f.pack_v, soc_pct=f.soc, pack_c=f.temperature_c)
    return Next(Trigger.CHARGE, why, changes)


def _qualified(f: Facts, since_s: float | None) -> bool:
    """Whether every condition for a charge has held for long enough."""
    return since_s is not None and f.now_s - since_s >= QUALIFY_S and _seen_twice(f, since_s) and f.stopped


def _seen_twice(f: Facts, since_s: float) -> bool:
    """Whether a newer sample of every value has come since; the first one was there when the time began."""
    battery = f.snapshot.battery
    values = (battery.voltage_v, battery.temperature_c, battery.status, battery.soc_pct, battery.soh_pct)
    return all(value is not None and value.t_s > since_s for value in values)
