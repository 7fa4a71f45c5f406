"""What becomes of an operator's request. A refusal names its cause; a reset permits a start, it does not make one."""

from collections.abc import Callable

from orchestrator.core import latches
from orchestrator.core.memory import Memory
from orchestrator.model import Request, State

STOPPED = "stopped by the operator"
#: So many resets of one fault are allowed within this time.
MAX_RESETS, RESETS_S = 3, 3600.0
RESET = "reset by the operator"
#: The holds that are an operator's own doing.
OWN = frozenset({STOPPED, RESET})


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
    faults, reasons = latches.release(before, now_s, by_reset=True)
    cleared = [name for name, fault in before.items() if fault.latched and name not in faults]
    resets = tuple(reset for reset in memory.resets if now_s - reset[0] < RESETS_S)
    reasons = reasons or [text for name in cleared if (text := _too_often(name, resets, now_s))]
    if reasons:
        return "; ".join(reasons)
    memory.faults, memory.resets = faults, resets + tuple((now_s, name) for name in cleared)
    if len(memory.faults) < len(before):  # in whatever state: the way on is a start, also while the stop is verified
        memory.hold = RESET
    return ""


def _too_often(name: str, resets: tuple[tuple[float, str], ...], now_s: float) -> str:
    """FAULTS P6: what comes again after every reset is not mended by resetting it."""
    times = [t_s for t_s, fault in resets if fault == name]
    if len(times) < MAX_RESETS:
        return ""
    minutes = (times[-MAX_RESETS] + RESETS_S - now_s) / 60
    return (
        f"{name} was reset {len(times)} times within an hour and came again each time: remove its cause; "
        f"it can be reset again in {minutes:.0f} min"
    )


VERBS: dict[Request, Callable[[Memory, float], str]] = {
    Request.START: _start,
    Request.PAUSE: _pause,
    Request.STOP: _stop,
    Request.RESET: _reset,
}
