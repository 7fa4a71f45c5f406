"""Handles an operator's request. A refusal names its cause; a reset permits a start but does not make one.

A request is accepted if it has an effect, or if what it asks for is already so. Any other request that would change
nothing is refused with what the bay does, or waits for. A stop is always accepted.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from orchestrator.core import latches
from orchestrator.core.active import evidence, times
from orchestrator.core.acts import RESETS_S, act, refused_for, refusing
from orchestrator.core.faults import ROW
from orchestrator.core.memory import FaultMemory, Memory, Operator
from orchestrator.core.parts import changed
from orchestrator.core.safestop import LASTS_S
from orchestrator.core.states import AT_WORK
from orchestrator.model import Cause, Request, State
from orchestrator.model.cause import parts, together

STOPPED, PAUSED, RESET = Cause("operator_stop"), Cause("operator_pause"), Cause("operator_reset")
#: The same with the person's name: who, when, why. They are made by the service; nothing here depends on the person.
NAMED = frozenset({"stopped_by", "estopped_by", "paused_by"})
#: The holds that an operator has caused.
OWN = frozenset({STOPPED.id, RESET.id, "reset_by", *NAMED})
#: Those that a later reset replaces; a named stop stays until a start.
RESETTABLE = frozenset({STOPPED.id, RESET.id, "reset_by"})
#: No more stops, or pauses, of different people are remembered at a time.
MOST_PEOPLE = 5
OUT_OF_CONTROL = Cause.of("out_of_control", lasts_s=LASTS_S)


@dataclass(frozen=True, slots=True)
class Heard:
    """What a request has changed; `refusal` is why it was not carried out."""

    operator: Operator
    faults: Mapping[str, FaultMemory]
    refusal: Cause | None = None


@dataclass(frozen=True, slots=True)
class Told:
    """What a refusal must know to say what to do."""

    bay: str  #: the name for commands
    at_rest: bool
    by: Cause | None  #: who requests it, and why, as the cause that this becomes
    target_pct: float | None = None  #: to which SOC a start shall charge once
    soc_pct: float | None = None  #: the battery's SOC now


def handle_request(
    memory: Memory,
    request: Request,
    now_s: float,
    not_persisted: Cause | None = None,
    bay: str = "BAY",
    *,
    at_rest: bool = False,
    by: Cause | None = None,
    target_pct: float | None = None,
    soc_pct: float | None = None,
) -> Heard:
    """Carry out the request or refuse it.

    `bay` is the name for commands; `at_rest`: the charger is in standby, verified; `by` is who requests it, if known.
    A start with a `target_pct` charges once to that SOC; `soc_pct` is the SOC now.
    A request that would allow a charge is refused while nothing can be saved (`not_persisted` says why); a stop never
    is.
    """
    if not_persisted is not None and request in (Request.START, Request.RESET):
        return _refused(memory, Cause.of("not_done", advice="not_persisted", problem=not_persisted))
    return VERBS[request](memory, now_s, Told(bay, at_rest, by, target_pct, soc_pct))


def stopped(known: Operator, by: Cause | None = None) -> Operator:
    """The operator's part of the memory after a stop."""
    return changed(over(known), hold=_joined(known.hold, by or STOPPED))


def over(known: Operator) -> Operator:
    """The operator's part of the memory once the one charge to a target is over, or its battery gone."""
    return known if known.target_pct is None else changed(known, target_pct=None, target_by=None)


def is_own(hold: Cause) -> bool:
    """Whether an operator, and nothing else, has caused this hold."""
    return all(one.id in OWN for one in parts(hold))


def pause(known: Operator) -> Cause | None:
    """The operator's pause, if there is one."""
    return (known.paused_by or PAUSED) if known.paused else None


def _joined(before: Cause | None, new: Cause) -> Cause:
    """This stop or pause, after those of other people that hold the bay as well."""
    known = () if before is None else parts(before)
    others = [one for one in known if one.id in NAMED and one.param("who") != new.param("who")]
    return together([*others[1 - MOST_PEOPLE :], new])


def held_back(known: Operator, why: Cause) -> Operator:
    """The operator's part of the memory where nobody but a person may let a charge begin, for this reason."""
    return changed(over(known), hold=why)


def _refused(memory: Memory, why: Cause) -> Heard:
    return Heard(memory.operator, memory.faults, why)


def _stop(memory: Memory, _now_s: float, told: Told) -> Heard:
    return Heard(stopped(memory.operator, told.by), memory.faults)


def _pause(memory: Memory, _now_s: float, told: Told) -> Heard:
    latched = tuple(name for name, fault in memory.faults.items() if fault.latched and fault.raised_s is not None)
    if latched:  # a reset leads to a start, which would end the pause
        return _refused(memory, Cause.of("reset_first", faults=latched))
    if memory.operator.hold:
        return _refused(memory, Cause.of("not_running", what=memory.operator.hold))
    by = _joined(memory.operator.paused_by, told.by or PAUSED)
    return Heard(changed(memory.operator, paused=True, paused_by=None if by == PAUSED else by), memory.faults)


def _start(memory: Memory, now_s: float, told: Told) -> Heard:
    if memory.state is State.UNCONTROLLABLE:
        return _refused(memory, OUT_OF_CONTROL)
    if refusals := _refusals(memory, now_s, told, Request.START):
        return _refused(memory, together(refusals))
    if told.target_pct is not None and (wrong := _not_to(told.target_pct, told.soc_pct)) is not None:
        return _refused(memory, wrong)
    before, known = memory.faults, memory.operator
    faults, _ = latches.release(before, now_s, by_reset=False)
    if told.target_pct is not None:
        known = changed(known, target_pct=told.target_pct, target_by=told.by)
    elif not (known.hold or known.paused) and len(faults) == len(before) and memory.state not in AT_WORK:
        return _refused(memory, Cause.of("nothing_to_start", state=memory.state.value, what=memory.cause))
    return Heard(changed(known, hold=None, paused=False, paused_by=None), faults)


def _not_to(target_pct: float, soc_pct: float | None) -> Cause | None:
    """Why no charge to this target can begin."""
    if soc_pct is None:
        return Cause("target_unseen")
    return Cause.of("target_reached", soc_pct=soc_pct, target_pct=target_pct) if soc_pct >= target_pct else None


def _reset(memory: Memory, now_s: float, told: Told) -> Heard:
    if memory.state is State.UNCONTROLLABLE:
        return _refused(memory, OUT_OF_CONTROL)
    if refusals := _refusals(memory, now_s, told, Request.RESET):
        return _refused(memory, together(refusals))
    before, known = memory.faults, memory.operator
    faults, _ = latches.release(before, now_s, by_reset=True)
    if len(faults) == len(before):
        return _refused(memory, Cause.of("nothing_to_reset", state=memory.state.value, what=memory.cause))
    cleared = [name for name, fault in before.items() if fault.latched and name not in faults]
    resets = tuple(reset for reset in known.resets if now_s - reset[0] < RESETS_S)
    resets += tuple((now_s, name) for name in cleared)
    # in any state, even while the stop is being verified: the way on is a start, which ends any other hold as well
    hold = (told.by or RESET) if known.hold is None or known.hold.id in RESETTABLE else known.hold
    return Heard(changed(known, hold=hold, resets=resets), faults)


def _refusals(memory: Memory, now_s: float, told: Told, request: Request) -> list[Cause]:
    """Why the request is refused now, and until when: one cause per fault in the way, with what to do about it."""
    return [
        Cause.of(
            "refused",
            fault=name,
            why=why,
            what=_what(memory, name, at_rest=told.at_rest),
            then=_first(memory, now_s, told.bay, name, why),
        )
        for name in refusing(memory, now_s, request)
        if (why := refused_for(memory, now_s, name, request)) is not None
    ]


def _what(memory: Memory, name: str, *, at_rest: bool) -> Cause:
    row, fault = ROW[name], memory.faults[name]
    return evidence(row, fault, at_rest=at_rest).with_(**dict(times(row, fault)))


def _first(memory: Memory, now_s: float, bay: str, name: str, why: Cause) -> Cause | None:
    """What ends the fault, if that differs from the wait for which the request was refused."""
    ends = act(memory, now_s, bay, name)
    return None if ends.same_as(why) else ends


VERBS: Mapping[Request, Callable[[Memory, float, Told], Heard]] = {
    Request.START: _start,
    Request.PAUSE: _pause,
    Request.STOP: _stop,
    Request.RESET: _reset,
}
