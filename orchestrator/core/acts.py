"""What ends a fault: itself, and when; or a person, with which command, and until when that is refused.

Theory of operation. The row says who ends it (`Clear`); the memory shows what prevents that now: the condition is still
true, it has not been gone for long enough, another fault is active, it was reset too often, or the charger was not seen
to stop. The same functions determine why a request is refused (`operator.py`), so a status line never names a command
that would be refused. Moments are monotonic seconds, in parameters called `…_t_s`; the service converts them to the
time of day.
"""

from math import ceil

from orchestrator.core import latches
from orchestrator.core.faults import ROW, Clear
from orchestrator.core.latches import BACKOFF_S, clear_after_s, in_the_way, raised
from orchestrator.core.memory import FaultMemory, Memory
from orchestrator.core.safestop import LASTS_S
from orchestrator.core.states import DONE, ENERGISED
from orchestrator.model import Cause, Effect, Request

#: This many resets of one fault are allowed within this time.
MAX_RESETS, RESETS_S = 3, 3600.0
#: While the persisted state cannot be written, nothing is cleared.
UNKEPT = "not_persisted"


def act(memory: Memory, now_s: float, bay: str, name: str, *, out: bool = False) -> Cause:
    """What ends the active fault `name`. `out`: its charger is out of control."""
    fault = memory.faults[name]
    wait_s = clear_after_s(ROW[name], fault)
    if wait_s is None:
        return _by_person(memory, now_s, bay, name, out=out)
    return _by_itself(memory, now_s, name, wait_s)


# --- by itself --------------------------------------------------------------------------------------------------------


def _by_itself(memory: Memory, now_s: float, name: str, wait_s: float) -> Cause:
    """How long after its condition is gone it ends.

    Only the worst fault says that the bay goes on, and only if no person is needed.
    """
    row, fault = ROW[name], memory.faults[name]
    strike = None
    if row.clear is Clear.BACKOFF:
        strike = Cause.of("strike", number=max(len(fault.strikes), 1), of=len(BACKOFF_S))
    verb = "goes_on" if _bars(memory, name) else "clears"
    if fault.clean_s is None:
        ends_s = row.until(memory) if row.until is not None else None
        if ends_s is not None:
            return Cause.of("counts_until", until_t_s=ends_s + wait_s)
        return Cause.of(f"{verb}_after_last" if row.moment else f"{verb}_after", wait_s=wait_s, strike=strike)
    ends_s, earliest = fault.clean_s + wait_s, ""
    if verb == "goes_on":
        others = [_ends_s(*item) for item in raised(memory.faults) if latches.effect(*item) >= Effect.NO_START]
        ends_s, earliest = max(end_s or 0.0 for end_s in others), "_at_the_earliest" if None in others else ""
    left_s = max(ceil(ends_s - now_s), 0)
    return Cause.of(
        f"{verb}_in{earliest}", gone=_gone(fault), left_s=left_s, until_t_s=ends_s, strike=strike
    )  # fmt: skip


def _gone(fault: FaultMemory) -> Cause:
    """Since when it is gone, or not seen: what a silent device does not report may still be there."""
    return Cause.of("not_seen" if fault.unheard else "gone", gone_t_s=fault.clean_s)


def _bars(memory: Memory, name: str) -> bool:
    """Whether this fault alone keeps a bay waiting that would go on by itself."""
    live = raised(memory.faults)
    waits = memory.operator.hold is not None or memory.operator.paused or memory.state in DONE
    by_person = any(clear_after_s(ROW[one], other) is None for one, other in live)
    least = Effect.PAUSE if memory.state in ENERGISED else Effect.NO_START  # a running charge waits for nothing
    return not waits and not by_person and live[0][0] == name and latches.effect(*live[0]) >= least


def _ends_s(name: str, fault: FaultMemory) -> float | None:
    """When a fault clears by itself, as far as known now."""
    wait_s = clear_after_s(ROW[name], fault)
    return None if wait_s is None or fault.clean_s is None else fault.clean_s + wait_s


# --- by a person ------------------------------------------------------------------------------------------------------


def _by_person(memory: Memory, now_s: float, bay: str, name: str, *, out: bool) -> Cause:
    fault = memory.faults[name]
    latched = any(other.latched for _, other in raised(memory.faults))
    request = Request.RESET if latched or ROW[name].clear is Clear.RESET else Request.START
    if out:
        return Cause.of("after_standby", request=request.value, lasts_s=LASTS_S)
    if refused := refused_for(memory, now_s, name, request):
        return refused
    not_persisted = memory.faults.get(UNKEPT)
    keeps = (
        [UNKEPT]
        if not_persisted is not None and not_persisted.raised_s is not None and not_persisted.clean_s is None
        else []
    )
    other = next(iter([*refusing(memory, now_s, request), *keeps]), None)
    if other is not None:
        return Cause.of("waits_for_fault", gone=_gone(fault), request=request.value, fault=other)
    return Cause.of(f"{request.value}_now", gone=_gone(fault), bay=bay)


def refusing(memory: Memory, now_s: float, request: Request) -> list[str]:
    """The faults for which this request is refused now, the most dangerous first."""
    by_reset = request is Request.RESET
    kept = in_the_way(memory.faults, now_s, by_reset=by_reset)
    if kept or not by_reset:
        return kept
    return [name for name, fault in raised(memory.faults) if fault.latched and locked_until_s(memory, now_s, name)]


def refused_for(memory: Memory, now_s: float, name: str, request: Request) -> Cause | None:
    """Why this fault cannot be cleared by the request now, and until when; None if it can."""
    row, fault, word = ROW[name], memory.faults[name], request.value
    if fault.latched and request is not Request.RESET:
        return Cause.of("needs_reset", request=word)
    locked_s = locked_until_s(memory, now_s, name) if fault.latched else None
    locked = Cause.of("reset_locked", until_t_s=locked_s, times=MAX_RESETS) if locked_s is not None else None
    if fault.clean_s is None:
        ends_s = row.until(memory) if row.until is not None else None
        if ends_s is not None:
            return Cause.of("refused_until", request=word, until_t_s=ends_s)
        lasts = Cause.of("refused_while", request=word)
        return lasts if locked is None else lasts.with_(then=locked)
    left_s = row.clean_s - (now_s - fault.clean_s)
    if left_s > 0 and locked is None:
        return Cause.of("refused_for", request=word, gone=_gone(fault), left_s=ceil(left_s))
    return locked


def locked_until_s(memory: Memory, now_s: float, name: str) -> float | None:
    """FAULTS P6: a fault that returns after every reset is not fixed by another one. None: it may be reset."""
    times = [t_s for t_s, fault in memory.operator.resets if fault == name and now_s - t_s < RESETS_S]
    return times[-MAX_RESETS] + RESETS_S if len(times) >= MAX_RESETS else None
