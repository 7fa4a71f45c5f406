"""What becomes of an operator's request. A refusal names its cause; a reset permits a start, it does not make one."""

from collections.abc import Callable

from orchestrator.core import latches
from orchestrator.core.memory import Memory
from orchestrator.model import Cause, Request, State
from orchestrator.model.cause import together

STOPPED = Cause("operator_stop", advice="start")
#: So many resets of one fault are allowed within this time.
MAX_RESETS, RESETS_S = 3, 3600.0
RESET = Cause("operator_reset", advice="start")


def hear(memory: Memory, request: Request, now_s: float) -> Cause | None:
    """Change the memory as the operator asks; None when it was done, else why not."""
    return VERBS[request](memory, now_s)


def _stop(memory: Memory, _now_s: float) -> Cause | None:
    memory.hold = STOPPED
    return None


def _pause(memory: Memory, _now_s: float) -> Cause | None:
    if memory.hold:
        return Cause.of("not_running", what=memory.hold)
    memory.paused = True
    return None


def _start(memory: Memory, now_s: float) -> Cause | None:
    if memory.state is State.UNCONTROLLABLE:
        return Cause("out_of_control")
    memory.faults, refusals = latches.release(memory.faults, now_s, by_reset=False)
    if refusals:
        return together(refusals)
    memory.hold, memory.paused = None, False
    return None


def _reset(memory: Memory, now_s: float) -> Cause | None:
    before = memory.faults
    faults, refusals = latches.release(before, now_s, by_reset=True)
    cleared = [name for name, fault in before.items() if fault.latched and name not in faults]
    resets = tuple(reset for reset in memory.resets if now_s - reset[0] < RESETS_S)
    refusals = refusals or [cause for name in cleared if (cause := _too_often(name, resets, now_s))]
    if refusals:
        return together(refusals)
    memory.faults, memory.resets = faults, resets + tuple((now_s, name) for name in cleared)
    if len(memory.faults) < len(before):  # in whatever state: the way on is a start, also while the stop is verified
        memory.hold = RESET
    return None


def _too_often(name: str, resets: tuple[tuple[float, str], ...], now_s: float) -> Cause | None:
    """FAULTS P6: what comes again after every reset is not mended by resetting it."""
    times = [t_s for t_s, fault in resets if fault == name]
    if len(times) < MAX_RESETS:
        return None
    wait_min = (times[-MAX_RESETS] + RESETS_S - now_s) / 60
    return Cause.of("reset_too_often", fault=name, times=len(times), wait_min=wait_min)


VERBS: dict[Request, Callable[[Memory, float], Cause | None]] = {
    Request.START: _start,
    Request.PAUSE: _pause,
    Request.STOP: _stop,
    Request.RESET: _reset,
}
