"""What becomes of an operator's request. A refusal names its cause; a reset permits a start, it does not make one.

Accepted is what has an effect, or what is so already. Any other request that would change nothing is refused with what
the bay does, or waits for; a stop alone is always accepted.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from orchestrator.core import latches
from orchestrator.core.memory import FaultMemory, Memory, Operator
from orchestrator.core.parts import changed
from orchestrator.core.safestop import LASTS_S
from orchestrator.core.states import AT_WORK
from orchestrator.model import Cause, Request, State
from orchestrator.model.cause import together

STOPPED = Cause("operator_stop")
#: So many resets of one fault are allowed within this time.
MAX_RESETS, RESETS_S = 3, 3600.0
RESET = Cause("operator_reset")
#: The holds that are an operator's own doing.
OWN = frozenset({STOPPED, RESET})
OUT_OF_CONTROL = Cause.of("out_of_control", lasts_s=LASTS_S)


@dataclass(frozen=True, slots=True)
class Heard:
    """What a request has changed; `refusal` is why it was not done."""

    operator: Operator
    faults: Mapping[str, FaultMemory]
    refusal: Cause | None = None


def hear(memory: Memory, request: Request, now_s: float, unkept: Cause | None = None) -> Heard:
    """What becomes of the request.

    What lets a charge begin is not done where it could not be kept (`unkept` says why); what stops one always is.
    """
    if unkept is not None and request in (Request.START, Request.RESET):
        return _refused(memory, Cause.of("not_done", problem=unkept))
    return VERBS[request](memory, now_s)


def stopped(known: Operator) -> Operator:
    """An operator has stopped the bay."""
    return changed(known, hold=STOPPED)


def _refused(memory: Memory, why: Cause) -> Heard:
    return Heard(memory.operator, memory.faults, why)


def _stop(memory: Memory, _now_s: float) -> Heard:
    return Heard(stopped(memory.operator), memory.faults)


def _pause(memory: Memory, _now_s: float) -> Heard:
    latched = tuple(name for name, fault in memory.faults.items() if fault.latched and fault.raised_s is not None)
    if latched:  # its reset leads to a start, which would end the pause
        return _refused(memory, Cause.of("reset_first", faults=latched))
    if memory.operator.hold:
        return _refused(memory, Cause.of("not_running", what=memory.operator.hold))
    return Heard(changed(memory.operator, paused=True), memory.faults)


def _start(memory: Memory, now_s: float) -> Heard:
    if memory.state is State.UNCONTROLLABLE:
        return _refused(memory, OUT_OF_CONTROL)
    before, known = memory.faults, memory.operator
    faults, refusals = latches.release(before, now_s, by_reset=False)
    if refusals:
        return _refused(memory, together(refusals))
    if not (known.hold or known.paused) and len(faults) == len(before) and memory.state not in AT_WORK:
        return _refused(memory, Cause.of("nothing_to_start", state=memory.state.value, what=memory.cause))
    return Heard(changed(known, hold=None, paused=False), faults)


def _reset(memory: Memory, now_s: float) -> Heard:
    if memory.state is State.UNCONTROLLABLE:
        return _refused(memory, OUT_OF_CONTROL)
    before, known = memory.faults, memory.operator
    faults, refusals = latches.release(before, now_s, by_reset=True)
    cleared = [name for name, fault in before.items() if fault.latched and name not in faults]
    resets = tuple(reset for reset in known.resets if now_s - reset[0] < RESETS_S)
    refusals = refusals or [cause for name in cleared if (cause := _too_often(name, resets, now_s))]
    if refusals:
        return _refused(memory, together(refusals))
    if len(faults) == len(before):
        return _refused(memory, Cause.of("nothing_to_reset", state=memory.state.value, what=memory.cause))
    resets += tuple((now_s, name) for name in cleared)
    # in whatever state: the way on is a start, also while the stop is verified
    return Heard(changed(known, hold=RESET, resets=resets), faults)


def _too_often(name: str, resets: tuple[tuple[float, str], ...], now_s: float) -> Cause | None:
    """FAULTS P6: what comes again after every reset is not mended by resetting it."""
    times = [t_s for t_s, fault in resets if fault == name]
    if len(times) < MAX_RESETS:
        return None
    wait_min = (times[-MAX_RESETS] + RESETS_S - now_s) / 60
    return Cause.of("reset_too_often", fault=name, times=len(times), wait_min=wait_min)


VERBS: Mapping[Request, Callable[[Memory, float], Heard]] = {
    Request.START: _start,
    Request.PAUSE: _pause,
    Request.STOP: _stop,
    Request.RESET: _reset,
}
