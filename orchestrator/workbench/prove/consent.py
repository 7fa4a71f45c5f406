"""The safety properties about people: what only they may undo, and what they must be told.

As in `properties.py`, nothing here uses the core's own predicates; from the fault table it takes only the rows' own
attributes.
"""

from collections.abc import Iterator

from orchestrator.core.faults import ROW, Clear
from orchestrator.core.memory import Memory
from orchestrator.core.states import ENERGISED, READY, UNSEEN, UNVERIFIED
from orchestrator.model import Alarm, Cause, Request, State
from orchestrator.workbench.prove.story import Taken

#: Causes that name the command with which it goes on, and those that say why that is refused until when.
COMMANDS = frozenset({"start_bay", "start_now", "reset_now"})
NOT_YET = frozenset({"refused_while", "refused_until", "refused_for", "reset_locked", "waits_for_fault"})
#: A standby after a stop in vain must last this long.
LASTS_S = 10.0


def operator_stops(taken: Taken) -> str | None:
    """An operator's stop or pause takes effect in the same decision, unless it is refused with a reason."""
    asked = taken.snapshot.request
    if asked not in (Request.STOP, Request.PAUSE) or taken.decision.answer:
        return None
    return f"{asked} was accepted, and the bay runs" if taken.after.state in ENERGISED else None


def held_until_started(taken: Taken) -> str | None:
    """Only an operator starts what an operator stopped."""
    before, after = taken.before, taken.after
    if before.operator.hold and not after.operator.hold and taken.snapshot.request is not Request.START:
        return "the hold was lifted without a start"
    return "runs in spite of a hold" if after.operator.hold and after.state in ENERGISED else None


def _waiting(memory: Memory) -> set[str]:
    """The active faults that only a person's start ends."""
    return {
        name for name, fault in memory.faults.items()
        if fault.raised_s is not None and ROW[name].clear is Clear.OPERATOR
    }  # fmt: skip


def waits_for_a_start(taken: Taken) -> str | None:
    """HELD is left by a person's start only, or to verify the stop anew; it says what to type, once, or why not yet.

    A battery that leaves clears the faults that its leaving explains, and no others.
    """
    before, after, asked = taken.before, taken.after, taken.snapshot.request
    waiting = _waiting(after)
    gone = _waiting(before) - waiting
    left = {name for name in gone if ROW[name].departs and not taken.snapshot.battery_link.online}
    if gone > left and asked not in (Request.START, Request.RESET):
        return f"{min(gone - left)} has gone without a person"
    waits = bool(after.operator.hold or waiting)
    if waits and after.state in READY:
        return f"{after.state}, though a person must start"
    if before.state is State.HELD and after.state in READY and not (asked is Request.START or left):
        return f"HELD was left for {after.state} without a start"
    return _says_what_to_type(taken, waits=waits) if after.state is State.HELD else None


def _says_what_to_type(taken: Taken, *, waits: bool) -> str | None:
    if not waits:
        return "HELD, and nothing waits for a person"
    parts = list(_parts(taken.decision.cause))
    told = [cause.param("bay") for cause in parts if cause.id in COMMANDS]
    well = told == [taken.rules.bay.name] or (not told and any(cause.id in NOT_YET for cause in parts))
    return None if well else f"HELD tells to start {told}"


def _parts(cause: Cause) -> Iterator[Cause]:
    """A cause and all causes among its parameters."""
    yield cause
    for _, value in cause.params:
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Cause):
                yield from _parts(part)


def tripped_until_reset(taken: Taken) -> str | None:
    """TRIPPED ends only with a person's reset, or to stop a running charger."""
    if taken.before.state is not State.TRIPPED or taken.after.state in (State.TRIPPED, State.STOPPING):
        return None
    if taken.move.restart and taken.after.state in UNVERIFIED:
        return None  # the stop is verified again; latches have their own property
    return None if taken.snapshot.request is Request.RESET else f"left for {taken.after.state} without a reset"


def latched_until_reset(taken: Taken) -> str | None:
    """Only a reset clears a latched fault."""
    gone = [
        name for name, fault in taken.before.faults.items()
        if fault.latched and (name not in taken.after.faults or not taken.after.faults[name].latched)
    ]  # fmt: skip
    return f"{gone[0]} has gone without a reset" if gone and taken.snapshot.request is not Request.RESET else None


def a_death_in_mid_charge_holds(taken: Taken) -> str | None:
    """An interrupted charge waits for a person."""
    ran = taken.before.state in ENERGISED or taken.before.stop.unverified
    if not taken.move.restart or not ran:
        return None
    return None if "found_running" in taken.after.faults else f"{taken.after.state} without a fault that waits"


def out_of_control_until_it_lasts(taken: Taken) -> str | None:
    """UNCONTROLLABLE takes at least the standby that must last, and a restart is not the end of it."""
    before, after = taken.before, taken.after
    if before.state is not State.UNCONTROLLABLE or after.state is State.UNCONTROLLABLE:
        return None
    if taken.move.restart:
        return f"left for {after.state} by a restart"
    lasted_s = taken.now_s - (before.since_s or 0.0)
    return f"left for {after.state} after {lasted_s:.1f} s" if lasted_s < LASTS_S else None


def alarmed(taken: Taken) -> str | None:
    """The alarm is danger for a charger out of control, or left unverified by an earlier run of the service.

    It is attention for one in standby with a fault that waits for a person, and none after an operator's stop.
    """
    after, alarm = taken.after, taken.decision.alarm
    left = after.stop.unverified and after.state in UNSEEN
    shared = bool(taken.snapshot.charger_link.locked_by) or "port_locked" in after.faults
    if after.state is State.UNCONTROLLABLE or left:
        right = alarm is Alarm.DANGER
    elif after.state is State.TRIPPED or (after.state is State.HELD and _waiting(after)):
        right = alarm is Alarm.ATTENTION or (shared and alarm is Alarm.DANGER)
    else:
        right = alarm is Alarm.NONE or (shared and alarm is Alarm.DANGER)
    return None if right else f"alarm {alarm.name} in {after.state}"
