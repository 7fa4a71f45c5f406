"""How faults come and go: debounce, latch, backoff, clear. Mechanism only; the table defines the faults.

Theory of operation. A row's predicate returns what is seen now. Once that has lasted for the row's time and number of
polls it becomes a fault, is followed in every state, and ends as its `Clear` says. Before that, its time and its polls
drain while the condition is false (`drain.py`), so an intermittent condition is found, too. A fault is never cleared
while its condition is true, and a latched one is cleared only by a person.

A predicate that raises is our own defect. That row can no longer be judged, so the bay trips by the row `internal`,
which is judged last; all other rows continue.
"""

from collections.abc import Mapping, Sequence

from orchestrator.core.drain import DRAIN, drained
from orchestrator.core.facts import Facts
from orchestrator.core.faults import FAULTS, RANK, ROW, Clear, FaultRow
from orchestrator.core.memory import FaultMemory
from orchestrator.core.parts import changed
from orchestrator.core.safestop import verified
from orchestrator.core.states import UNVERIFIED
from orchestrator.model import Cause, Effect, State

#: How long the condition must be gone before a backoff begins, and the backoffs (FAULTS, "B").
CLEAN_S = 10.0
BACKOFF_S = (10.0, 60.0, 300.0)
#: Strikes are forgotten after this long; one more strike than there are backoffs latches.
STRIKES_S = 3600.0
#: Of a row that has seen nothing until now.
UNKNOWN = FaultMemory()


def update(f: Facts) -> Mapping[str, FaultMemory]:
    """The fault memory after this decision's facts."""
    before, state, looked_s = f.memory.faults, f.memory.state, f.memory.looked_s
    passed_s = f.now_s - looked_s if looked_s is not None else 0.0
    battery_removed = f.battery_removed and not f.energised
    after: dict[str, FaultMemory] = {}
    for row in _looked_for(state, before):
        fault = before.get(row.id) if before else None
        if battery_removed and row.departs and not (fault is not None and fault.latched):
            strikes = tuple(t for t in fault.strikes if t != fault.raised_s) if fault is not None else ()
            if strikes:  # the removal looked like this fault but was none; earlier strikes count
                after[row.id] = FaultMemory(strikes=strikes)
            continue
        seen = None
        if fault is None or _is_looked_for(row, fault, state, battery_removed=battery_removed):
            try:
                seen = row.check(f)
            except Exception as error:  # noqa: BLE001 - one row must not take the others, nor the machine, with it
                why = Cause.of("not_judged", fault=row.id, error=repr(error))
                f = changed(f, broken=(*f.broken, why))
        if seen is not None:
            after[row.id] = _present(row, fault or UNKNOWN, seen, f, passed_s)
        elif fault is not None:
            kept = _absent(row, fault, f, passed_s)
            if kept is not None:
                after[row.id] = kept
    return after if after or before else before


def _is_looked_for(row: FaultRow, fault: FaultMemory, state: State, *, battery_removed: bool) -> bool:
    """Whether to look for a known fault's condition; an active fault is followed in every state."""
    return not (battery_removed and row.departs) and (fault.raised_s is not None or state in row.where)


def _looked_for(state: State, known: Mapping[str, FaultMemory]) -> Sequence[FaultRow]:
    """The rows looked for in this state, in table order, and before them the other known ones."""
    usual = _USUAL.get(state)
    if usual is None or usual[0] is not FAULTS:
        rows = tuple(row for row in FAULTS if state in row.where)
        usual = _USUAL[state] = FAULTS, rows, frozenset(row.id for row in rows)
    if known.keys() <= usual[2]:
        return usual[1]
    return [*(ROW[name] for name in known if name not in usual[2]), *usual[1]]


#: The rows of each state and their ids, and the table that they come from.
_USUAL: dict[State, tuple[Sequence[FaultRow], Sequence[FaultRow], frozenset[str]]] = {}


def _polls(fault: FaultMemory, f: Facts, *, holds: bool) -> tuple[float, float]:
    """The number of readings that showed it, counting or draining a new one; and the time of the newest reading."""
    poll_t_s = f.reading.t_s if f.reading else fault.poll_t_s
    if fault.polls and poll_t_s == fault.poll_t_s:
        return fault.polls, poll_t_s
    return (fault.polls + 1 if holds else max(0.0, fault.polls - DRAIN)), poll_t_s


def _present(row: FaultRow, fault: FaultMemory, seen: Cause, f: Facts, passed_s: float) -> FaultMemory:
    polls, poll_t_s = _polls(fault, f, holds=True)
    # Time before the first look does not count: the condition may have begun just now.
    seen_s = drained(fault.seen_s, passed_s, holds=True) if fault.present else fault.seen_s
    if fault.raised_s is not None:
        worst = _worst(row, seen, fault.worst, fault.cause or seen)
        return changed(
            fault, present=True, seen_s=seen_s, polls=polls, poll_t_s=poll_t_s, clean_s=None, now=seen, worst=worst
        )
    if seen_s < row.for_s or polls < row.polls:
        return changed(fault, present=True, seen_s=seen_s, polls=polls, poll_t_s=poll_t_s, clean_s=None)
    strikes = fault.strikes
    if row.clear is Clear.BACKOFF:
        strikes = (*(t for t in strikes if f.now_s - t < STRIKES_S), f.now_s)
    latched = row.clear is Clear.RESET or len(strikes) > len(BACKOFF_S)
    return changed(
        fault, present=True, seen_s=seen_s, polls=polls, poll_t_s=poll_t_s, clean_s=None, raised_s=f.now_s, cause=seen,
        latched=latched, strikes=strikes, now=seen, worst=_worst(row, seen, None, seen),
    )  # fmt: skip


def _worst(row: FaultRow, seen: Cause, worst: float | None, first: Cause) -> float | None:
    """The worst value so far of the evidence's single figure, if it has one and its quantity is still the same."""
    names = [name for name in row.figures.split() if seen.param(name) is not None]
    if len(names) != 1 or first.param(names[0]) is None:
        return None
    known: list[float] = [seen.param(names[0]), first.param(names[0]) if worst is None else worst]
    return min(known) if row.lowest else max(known)


def _absent(row: FaultRow, fault: FaultMemory, f: Facts, passed_s: float) -> FaultMemory | None:
    """What is left of a fault while its condition is false; None if nothing is."""
    now_s = f.now_s
    if fault.raised_s is None:
        remembered = tuple(t for t in fault.strikes if now_s - t < STRIKES_S)
        seen_s = drained(fault.seen_s, passed_s, holds=False) if row.for_s else 0.0
        polls, poll_t_s = _polls(fault, f, holds=False) if row.polls > 1 else (0.0, 0.0)
        if not (remembered or seen_s or polls):
            return None
        return FaultMemory(seen_s=seen_s, polls=polls, poll_t_s=poll_t_s, strikes=remembered)
    clean_s = fault.clean_s if fault.clean_s is not None else now_s
    wait_s = clear_after_s(row, fault)
    if wait_s is not None and now_s - clean_s >= wait_s:
        return FaultMemory(strikes=fault.strikes) if fault.strikes else None
    cause = fault.cause
    if row.past is not None and cause is not None and f.memory.state in UNVERIFIED and verified(f):
        cause = row.past(cause, row.for_s + clean_s - fault.raised_s)
    unheard = f.silent or f.reading is None or row.id not in ROW  # nothing looks for a fault of another version
    return changed(fault, present=False, seen_s=0.0, polls=0.0, clean_s=clean_s, cause=cause, now=None, unheard=unheard)


def clear_after_s(row: FaultRow, fault: FaultMemory) -> float | None:
    """How long the condition must be gone before the fault clears by itself; None: a person must act."""
    if fault.latched or row.clear in (Clear.OPERATOR, Clear.RESET):
        return None
    if row.clear is Clear.BACKOFF:
        return CLEAN_S + BACKOFF_S[max(len(fault.strikes), 1) - 1]
    return row.clean_s


def effect(name: str, fault: FaultMemory) -> Effect:
    """A latched fault trips, whatever its row says."""
    return Effect.TRIP if fault.latched else ROW[name].effect


def raised(faults: Mapping[str, FaultMemory]) -> list[tuple[str, FaultMemory]]:
    """The active faults, the most dangerous first."""
    live = [(name, fault) for name, fault in faults.items() if fault.raised_s is not None]
    if len(live) > 1:
        live.sort(key=lambda item: (-effect(*item), RANK[item[0]]))
    return live


def release(
    faults: Mapping[str, FaultMemory], now_s: float, *, by_reset: bool
) -> tuple[dict[str, FaultMemory], list[str]]:
    """Clear what a person may clear: a reset clears everything, a start whatever waits for a start.

    Returns the remaining faults, and those that cannot be cleared now; if there are any, nothing is cleared.
    """
    waiting = {name for name, fault in raised(faults) if clear_after_s(ROW[name], fault) is None}
    kept = in_the_way(faults, now_s, by_reset=by_reset)
    return {name: fault for name, fault in faults.items() if kept or name not in waiting}, kept


def in_the_way(faults: Mapping[str, FaultMemory], now_s: float, *, by_reset: bool) -> list[str]:
    """The faults that refuse a start, or a reset, now, the most dangerous first."""
    return [
        name
        for name, fault in raised(faults)
        if clear_after_s(ROW[name], fault) is None
        and ((fault.latched and not by_reset) or fault.clean_s is None or now_s - fault.clean_s < ROW[name].clean_s)
    ]
