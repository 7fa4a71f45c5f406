"""Where a bay belongs whose charger is in verified standby: one row per reason to rest; the first that holds wins."""

from collections.abc import Callable

from orchestrator.core.active import active_faults
from orchestrator.core.facts import Facts
from orchestrator.core.faults import ROW, Clear
from orchestrator.core.finish import full_due, goes_on, once, target
from orchestrator.core.machine import Trigger
from orchestrator.core.memory import with_values
from orchestrator.core.operator import is_own, pause
from orchestrator.core.outofcontrol import problem
from orchestrator.core.states import DONE
from orchestrator.model import ActiveFault, Cause, Effect, State
from orchestrator.model.cause import together

Faults = tuple[ActiveFault, ...]
Found = tuple[Trigger, Cause] | None

#: When a battery is due to be charged all the way (`full_every_days`), at this SOC it is as good as full.
FULL_DUE_PCT = 98.0
#: A full battery must have lost this much before it is charged again, however high the policy's threshold.
RECHARGE_DROP_PCT = 3.0


def resting_place(f: Facts, faults: Faults) -> tuple[Trigger, Cause]:
    """The trigger that leads to where the bay belongs (it may be there already), and why."""
    return next(found for find in PLACES if (found := find(f, faults)) is not None)


def _trips(f: Facts, faults: Faults) -> Found:
    worst = faults[0] if faults else None
    if worst is None or worst.effect is not Effect.TRIP or (_lost(f) and f.memory.state is not State.TRIPPED):
        return None
    return Trigger.TRIP, _told(f, worst)


def _lost(f: Facts) -> bool:
    return not f.charger.online or f.reading is None


def _loses(f: Facts, _faults: Faults) -> Found:
    return (Trigger.LOSE, offline(f)) if _lost(f) else None


def _waits(f: Facts, faults: Faults) -> Found:
    waits = next((x for x in faults if ROW[x.id].clear is Clear.OPERATOR), None)
    return (Trigger.HOLD, _told(f, waits)) if waits is not None else None


def _told(f: Facts, fault: ActiveFault) -> Cause:
    """The fault, and a hold that no operator has caused: what was wired where can be why the fault is here."""
    hold = f.memory.operator.hold
    return fault.told if hold is None or is_own(hold) else together([fault.told, hold])


def _holds(f: Facts, _faults: Faults) -> Found:
    hold = f.memory.operator.hold
    return (Trigger.HOLD, held(f, hold)) if hold is not None else None


def _ends(f: Facts, _faults: Faults) -> Found:
    why = ending(f)
    if why is None:
        return None
    return (Trigger.REST if f.memory.session is None else Trigger.SUSPEND), why  # the charge goes on after it


def _pauses(f: Facts, _faults: Faults) -> Found:
    why = pause(f.memory.operator)
    return (Trigger.SUSPEND, held(f, why)) if why is not None else None


def absent(f: Facts, _faults: Faults = ()) -> Found:
    """Where a bay belongs without a battery, or with one that is not heard."""
    if f.battery.online and not f.silent:
        return None
    if f.battery_removed:
        return Trigger.REST, Cause("battery_absent")
    id_ = "bmu_just_booted" if f.just_booted else "bmu_does_not_answer"
    what = f.battery.problem or Cause.of(id_, node_id=f.rules.bay.battery.node_id)
    return Trigger.LOSE, Cause.of("battery_not_heard", charger_v=f.volts or 0.0, what=what)


def _charged(f: Facts, _faults: Faults) -> Found:
    wanted, why = _wanted(f)
    if wanted:
        return None
    if f.memory.battery.full_pct is not None:
        return Trigger.FILL, _full(f, why)
    return (Trigger.REST, why) if f.soc is not None else None


def _full(f: Facts, why: Cause) -> Cause:
    """Why the battery counts as full, and what begins the next charge."""
    ended = f.memory.stop.stop_cause
    known = ended if ended is not None and ended.id == "full" else Cause("full_before")
    again = Cause("charged_again", why.params, why.key, why.place) if why.id == "soc_not_below" else why
    return Cause(known.id, (*known.params, ("past", True), ("then", again)), known.key, known.place)


def _barred(f: Facts, faults: Faults) -> Found:
    worst = faults[0] if faults else None
    if worst is None or worst.effect < Effect.NO_START:
        return None
    if f.memory.state in DONE:  # it is told where the bay goes: there it waits to go on
        waiting = with_values(f.memory, state=State.SUSPENDED)
        worst = active_faults(waiting, f.now_s, f.rules.bay.name, f, at_rest=True)[0]
    return Trigger.SUSPEND, worst.told


def unsupplied(f: Facts, _faults: Faults = ()) -> Found:
    """Where a bay belongs that is granted no level."""
    why = f.snapshot.granted_why
    if f.snapshot.granted != 0 or why is None:
        return None
    return Trigger.SUSPEND, Cause.of("waits_for_supply", key=why.key, place=why.place, what=why)


def _remains(f: Facts, _faults: Faults) -> Found:
    wanted, why = _wanted(f)
    return (Trigger.QUALIFY if wanted else Trigger.REST), why


#: The reasons to rest. Each returns where to, or None if it does not hold; the order is explained row by row.
PLACES: tuple[Callable[[Facts, Faults], Found], ...] = (
    _trips,  # a person must look before anything else; without a verified stop, a lost charger comes first
    _loses,  # every place below promises a verified standby, so the line comes first
    _waits,  # a fault that a person ends: its advice is more urgent, and the same start ends a hold, too
    _holds,  # nobody and nothing else continues what a person has stopped
    _ends,  # no charge begins that the end of the service would stop; a pause returns after it
    _pauses,  # the operator's pause comes before what the battery wants
    absent,  # nothing below can be judged without a battery
    _charged,  # a battery that wants nothing waits for nothing, faults or not
    _barred,  # it goes on by itself once nothing prevents a charge
    unsupplied,  # a fault that prevents a charge matters more: it may be waiting for a person
    _remains,  # what the battery wants
)


def held(f: Facts, hold: Cause) -> Cause:
    """Why a person must start, and how."""
    return hold.with_(then=Cause.of("to_go_on", how=_start(f)))


def _start(f: Facts) -> Cause:
    return Cause.of("start_bay", bay=f.rules.bay.name)


def _wanted(f: Facts) -> tuple[bool, Cause]:
    """Whether the battery wants a charge, and why (not)."""
    policy, full_pct, asked_pct = f.rules.policy, f.memory.battery.full_pct, f.memory.operator.target_pct
    interrupted = full_pct is None and f.memory.session is not None
    if f.soc is None:
        return False, Cause("soc_unknown")
    if interrupted and (unfinished := goes_on(f)):  # an interrupted charge is completed
        return True, unfinished
    if asked_pct is not None:
        below = f.soc < asked_pct
        id_ = "once_below" if below else "once_not_below"
        return below, Cause.of(id_, soc_pct=f.soc, target_pct=asked_pct, what=once(f.memory.operator))
    if interrupted:
        threshold, key = target(f)
    elif full_pct is None:
        key, threshold = "start.soc_below_pct", policy.start.soc_below_pct
    elif full_due(f):  # it is full only by its target
        key, threshold = "finish.full_every_days", FULL_DUE_PCT
    else:  # it may be full by taper at less than the policy's SOC, so it must have fallen since
        key, threshold = "recharge.soc_below_pct", min(policy.recharge.soc_below_pct, full_pct - RECHARGE_DROP_PCT)
    below = f.soc < threshold
    id_ = "soc_below" if below else "soc_not_below"
    return below, f.rules.by_policy(id_, key, soc_pct=f.soc, threshold_pct=threshold)


def ending(f: Facts) -> Cause | None:
    """That the service is about to end, and why; None if it is not."""
    return Cause.of("service_ends", why=f.snapshot.ending) if f.snapshot.ending is not None else None


def offline(f: Facts) -> Cause:
    """The charger is not heard."""
    return problem(f, "charger_offline")
