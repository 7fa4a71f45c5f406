"""What becomes of an operator's request. A refusal names its cause; a reset permits a start, it does not make one."""

from collections.abc import Callable

from orchestrator.core import latches
from orchestrator.core.memory import Memory
from orchestrator.model import Request, State

STOPPED = "stopped by the operator; start to go on"
RESET = "reset by the operator; start to go on"


def hear(memory: Memory, request: Request, now_s: float) -> str:
    """Change the memory as the operator asks; "" when it was done, else why not."""
    return VERBS[request](memory, now_s)


def _stop(memory: Memory, _now_s: float) -> str:
    memory.hold = STOPPED
    return ""


def _pause(memory: Memory, _now_s: float) -> str:
    if memory.hold:
        return f"not running: {memory.hold}"
    memory.paused = True
    return ""


def _start(memory: Memory, now_s: float) -> str:
    if memory.state is State.UNCONTROLLABLE:
        return "the charger does not obey: cut its mains; nothing can start here"
    memory.faults, reasons = latches.release(memory.faults, now_s, by_reset=False)
    if reasons:
        return "; ".join(reasons)
    memory.hold, memory.paused = "", False
    return ""


def _reset(memory: Memory, now_s: float) -> str:
    before = memory.faults
    memory.faults, reasons = latches.release(before, now_s, by_reset=True)
    if reasons:
        return "; ".join(reasons)
    if len(memory.faults) < len(before):  # in whatever state: the way on is a start, also while the stop is verified
        memory.hold = RESET
    return ""


VERBS: dict[Request, Callable[[Memory, float], str]] = {
    Request.START: _start,
    Request.PAUSE: _pause,
    Request.STOP: _stop,
    Request.RESET: _reset,
}
