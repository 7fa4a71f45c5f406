"""What becomes of an operator's request. A refusal names its cause; a reset permits a start, it does not make one.

Accepted is what has an effect, or what is so already. Any other request that would change nothing is refused with what
the bay does, or waits for; a stop alone is always accepted.
"""

from collections.abc import Callable

from orchestrator.core import latches
from orchestrator.core.memory import Memory
from orchestrator.core.safestop import LASTS_S
from orchestrator.model import ENERGISED, Request, State

#: A charge has been started already.
AT_WORK = ENERGISED | {State.QUALIFYING}
STOPPED = "stopped by the operator"
#: So many resets of one fault are allowed within this time.
MAX_RESETS, RESETS_S = 3, 3600.0
RESET = "reset by the operator"
#: The holds that are an operator's own doing.
OWN = frozenset({STOPPED, RESET})
OUT_OF_CONTROL = (
    "the charger was not seen to stop: cut its mains; nothing can be started or reset here before it has stood by for "
    f"{LASTS_S:g} s"
)


def hear(memory: Memory, request: Request, now_s: float, unkept: str = "") -> str:
    """Change the memory as the operator asks; "" when it was done, else why not.

    What lets a charge begin is not done where it could not be kept (`unkept` says why); what stops one always is.
    """
    if unkept and request in (Request.START, Request.RESET):
        return f"not done: {unkept}"
    return VERBS[request](memory, now_s)


def _stop(memory: Memory, _now_s: float) -> str:
    memory.hold = STOPPED
    return ""


def _pause(memory: Memory, _now_s: float) -> str:
    latched = [name for name, fault in memory.faults.items() if fault.latched and fault.raised_s is not None]
    if latched:  # its reset leads to a start, which would end the pause
        return f"not running: {', '.join(latched)} must be reset first"
    if memory.hold:
        return f"not running: {memory.hold}"
    memory.paused = True
    return ""


def _start(memory: Memory, now_s: float) -> str:
    if memory.state is State.UNCONTROLLABLE:
        return OUT_OF_CONTROL
    before = memory.faults
    memory.faults, reasons = latches.release(before, now_s, by_reset=False)
    if reasons:
        return "; ".join(reasons)
    if not (memory.hold or memory.paused) and len(memory.faults) == len(before) and memory.state not in AT_WORK:
        return f"nothing to start: {memory.state}: {memory.reason}"
    memory.hold, memory.paused = "", False
    return ""


def _reset(memory: Memory, now_s: float) -> str:
    if memory.state is State.UNCONTROLLABLE:
        return OUT_OF_CONTROL
    before = memory.faults
    faults, reasons = latches.release(before, now_s, by_reset=True)
    cleared = [name for name, fault in before.items() if fault.latched and name not in faults]
    resets = tuple(reset for reset in memory.resets if now_s - reset[0] < RESETS_S)
    reasons = reasons or [text for name in cleared if (text := _too_often(name, resets, now_s))]
    if reasons:
        return "; ".join(reasons)
    if len(faults) == len(before):
        return f"nothing to reset: {memory.state}: {memory.reason}"
    memory.faults, memory.resets = faults, resets + tuple((now_s, name) for name in cleared)
    memory.hold = RESET  # in whatever state: the way on is a start, also while the stop is verified
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
