"""What becomes of an operator's request. A refusal names its cause; a reset permits a start, it does not make one.

Accepted is what has an effect, or what is so already. Any other request that would change nothing is refused with what
the bay does, or waits for; a stop alone is always accepted.
"""

from collections.abc import Callable

from orchestrator.core import latches
from orchestrator.core.active import evidence, times
from orchestrator.core.acts import RESETS_S, act, refused_for, refusing
from orchestrator.core.faults import ROW
from orchestrator.core.memory import Memory
from orchestrator.core.safestop import LASTS_S
from orchestrator.model import ENERGISED, Cause, Request, State
from orchestrator.model.cause import together

#: A charge has been started already.
AT_WORK = ENERGISED | {State.QUALIFYING}
STOPPED = Cause("operator_stop")
RESET = Cause("operator_reset")
#: The holds that are an operator's own doing.
OWN = frozenset({STOPPED, RESET})
OUT_OF_CONTROL = Cause.of("out_of_control", lasts_s=LASTS_S)


def hear(memory: Memory, request: Request, now_s: float, unkept: str = "", bay: str = "BAY") -> Cause | None:
    """Change the memory as the operator asks; None when it was done, else why not.

    What lets a charge begin is not done where it could not be kept (`unkept` says why); what stops one always is.
    """
    if unkept and request in (Request.START, Request.RESET):
        return Cause.of("not_done", advice="unkept", problem=unkept)
    return VERBS[request](memory, now_s, bay)


def _stop(memory: Memory, _now_s: float, _bay: str) -> Cause | None:
    memory.hold = STOPPED
    return None


def _pause(memory: Memory, _now_s: float, _bay: str) -> Cause | None:
    latched = tuple(name for name, fault in memory.faults.items() if fault.latched and fault.raised_s is not None)
    if latched:  # its reset leads to a start, which would end the pause
        return Cause.of("reset_first", faults=latched)
    if memory.hold:
        return Cause.of("not_running", what=memory.hold)
    memory.paused = True
    return None


def _start(memory: Memory, now_s: float, bay: str) -> Cause | None:
    if memory.state is State.UNCONTROLLABLE:
        return OUT_OF_CONTROL
    before = memory.faults
    if refusals := _refusals(memory, now_s, bay, Request.START):
        return together(refusals)
    memory.faults, _ = latches.release(before, now_s, by_reset=False)
    if not (memory.hold or memory.paused) and len(memory.faults) == len(before) and memory.state not in AT_WORK:
        return Cause.of("nothing_to_start", state=memory.state.value, what=memory.cause)
    memory.hold, memory.paused = None, False
    return None


def _reset(memory: Memory, now_s: float, bay: str) -> Cause | None:
    if memory.state is State.UNCONTROLLABLE:
        return OUT_OF_CONTROL
    before = memory.faults
    if refusals := _refusals(memory, now_s, bay, Request.RESET):
        return together(refusals)
    faults, _ = latches.release(before, now_s, by_reset=True)
    if len(faults) == len(before):
        return Cause.of("nothing_to_reset", state=memory.state.value, what=memory.cause)
    resets = tuple(reset for reset in memory.resets if now_s - reset[0] < RESETS_S)
    cleared = [name for name, fault in before.items() if fault.latched and name not in faults]
    memory.faults, memory.resets = faults, resets + tuple((now_s, name) for name in cleared)
    memory.hold = RESET  # in whatever state: the way on is a start, also while the stop is verified
    return None


def _refusals(memory: Memory, now_s: float, bay: str, request: Request) -> list[Cause]:
    """Why it cannot be done now, and until when: of each fault that stands in the way, and what to do about it."""
    return [
        Cause.of("refused", fault=name, why=why, what=_what(memory, name), then=_first(memory, now_s, bay, name, why))
        for name in refusing(memory, now_s, request)
        if (why := refused_for(memory, now_s, name, request)) is not None
    ]


def _what(memory: Memory, name: str) -> Cause:
    row, fault = ROW[name], memory.faults[name]
    return evidence(row, fault).with_(**dict(times(row, fault)))


def _first(memory: Memory, now_s: float, bay: str, name: str, why: Cause) -> Cause | None:
    """What ends it, where that is something else than the wait for which the request was refused."""
    ends = act(memory, now_s, bay, name)
    return None if ends.same_as(why) else ends


VERBS: dict[Request, Callable[[Memory, float, str], Cause | None]] = {
    Request.START: _start,
    Request.PAUSE: _pause,
    Request.STOP: _stop,
    Request.RESET: _reset,
}
