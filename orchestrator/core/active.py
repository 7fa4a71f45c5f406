"""The active faults as people read them: in the right tense, with their times, their figures and what to do.

While the condition is true, the evidence is what is seen now. Once it is gone, the evidence is what was seen when the
fault was raised, with the present values of the same quantities beside it. None of this is an event: figures and
countdowns change with every look, and a fault is the same for as long as its id and its effect are.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from orchestrator.core.acts import act
from orchestrator.core.facts import Facts
from orchestrator.core.faults import ROW, Clear, FaultRow
from orchestrator.core.latches import effect, raised
from orchestrator.core.memory import FaultMemory, Memory
from orchestrator.core.parts import made
from orchestrator.model import Account, ActiveFault, Cause, State

#: The present value of each quantity used in evidence, by its parameter name.
LIVE: Mapping[str, Callable[[Facts], float | None]] = {
    "charger_v": lambda f: f.volts,
    "charger_a": lambda f: f.amps,
    "pack_v": lambda f: f.pack_v,
    "pack_a": lambda f: f.pack_a,
    "pack_c": lambda f: f.temperature_c,
    "soc_pct": lambda f: f.soc,
    "soh_pct": lambda f: f.soh,
    "bad_pct": lambda f: f.charger.bad_pct,
}

#: Evidence that calls for something else than its row's advice: for the advice under its own id.
OWN_ADVICE = frozenset({"unfinished", "temperature_jump"})
#: Problems of a line whose sentence ends with what to do about exactly them.
SAY_WHAT_TO_DO = frozenset({
    "port_missing", "port_gone", "port_busy", "port_forbidden", "port_not_serial", "port_stubborn", "port_stalled",
    "port_taken", "port_too_many_files", "port_not_rs485", "charger_no_reply", "charger_noise", "charger_complains",
    "charger_late", "bmu_stopped", "bmu_late", "bmu_unreachable",
})  # fmt: skip
#: The advice for a fault that this version does not know.
UNKNOWN = "unknown_fault"


def active_faults(
    memory: Memory, now_s: float, bay: str, f: Facts | None = None, *, at_rest: bool = False
) -> tuple[ActiveFault, ...]:
    """The active faults, the most dangerous first. `f` is None if nothing is known of the bay now.

    `at_rest`: the charger is in standby, verified.
    """
    return tuple(
        made(
            ActiveFault,
            name,
            effect(name, fault),
            fault.raised_s or 0.0,
            partial(account, memory, now_s, bay, name, f, at_rest=at_rest),
            fault.clean_s,
            fault.cause,
        )
        for name, fault in raised(memory.faults)
    )


def account(memory: Memory, now_s: float, bay: str, name: str, f: Facts | None, *, at_rest: bool) -> Account:
    """What people read of this active fault; the parameters are those of `active_faults`."""
    row, fault = ROW[name], memory.faults[name]
    return Account(
        evidence(row, fault, at_rest=at_rest),
        act(memory, now_s, bay, name, out=memory.state is State.UNCONTROLLABLE and not at_rest),
        times(row, fault, f),
    )


def evidence(row: FaultRow, fault: FaultMemory, *, at_rest: bool = False) -> Cause:
    """What is, or was, seen, and what to do about it."""
    more: dict[str, Any] = {"effect": effect(row.id, fault).name}
    if fault.latched and len(fault.strikes) > 1:
        more["strikes"] = len(fault.strikes)
    if fault.clean_s is not None or row.moment:
        more["past"] = True
    seen = fault.now if fault.now is not None and not row.moment else fault.cause
    known = seen or Cause(row.id)
    advice = known.id if known.id in OWN_ADVICE else row.id
    if at_rest and row.at_rest:
        advice = row.at_rest
    if row.id not in ROW:
        known, advice = unknown(row.id, seen), UNKNOWN
    nothing_left = row.clear is Clear.AUTO and fault.clean_s is not None
    if nothing_left or (known.id in SAY_WHAT_TO_DO and not fault.latched):
        advice = ""
    return known.with_(advice, **more)


def unknown(name: str, kept: Cause | None) -> Cause:
    """A fault that only another version knows, with the evidence that was kept of it."""
    return Cause.of("fault_of_another_version", fault=name, what=kept.with_(past=True) if kept is not None else None)


def times(row: FaultRow, fault: FaultMemory, f: Facts | None = None) -> tuple[tuple[str, Any], ...]:
    """Since when it has been active, or when it was raised; and its figures then and now."""
    names, raised_s = row.figures.split(), fault.raised_s
    then = figures(fault.cause, names)
    if fault.clean_s is not None or row.moment:
        known = [(name, LIVE[name](f)) for name, _ in then if name in LIVE] if f is not None else []
        now = _figures([(name, value) for name, value in known if value is not None])
        more = {"raised_t_s": raised_s, "worst": _worse(row, fault, then), "now": now if len(now) == len(then) else ()}
    else:
        now_seen = figures(fault.now, names)
        alike = dict(then).keys() == dict(now_seen).keys()  # the evidence may be about another quantity by now
        was = _figures(then) if alike and then != now_seen else ()
        worst = None if not now_seen or fault.worst in dict(now_seen).values() else _worse(row, fault, then)
        more = {"since_t_s": raised_s, "was": was, "worst": worst}
    return tuple((name, value) for name, value in more.items() if value)


def figures(cause: Cause | None, names: list[str]) -> list[tuple[str, float]]:
    """The figures in a piece of evidence."""
    return [(name, cause.param(name)) for name in names if cause is not None and cause.param(name) is not None]


def _figures(known: list[tuple[str, float]]) -> tuple[Cause, ...]:
    """Each with its unit, which follows the first underscore of its name."""
    return tuple(Cause.of(f"figure_{name.partition('_')[2]}", value=value) for name, value in known)


def _worse(row: FaultRow, fault: FaultMemory, then: list[tuple[str, float]]) -> Cause | None:
    """The worst value, if it differs from the first."""
    if fault.worst is None or len(then) != 1 or fault.worst == then[0][1]:
        return None
    return Cause.of("down_to" if row.lowest else "up_to", figure=_figures([(then[0][0], fault.worst)])[0])
