"""How long a charge still takes, by our own estimate. Pure.

Theory of operation. The charge missing to the target (capacity × missing SOC) flows at the current that each row of the
policy's SOC table allows, in proportion to what the charger delivers of its step now. All other limits are assumed to
stay as they are. The capacity is what this charge has shown so far (Ah per percent), else the policy's, reduced by the
SOH. A taper cannot be foreseen; once it has begun there is no estimate.
"""

from collections.abc import Iterator
from math import inf

from orchestrator.config.amperes import highest_step
from orchestrator.core.facts import Facts
from orchestrator.core.finish import goes_full, tapers, target
from orchestrator.core.limits import bounds
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import Snapshot, State
from orchestrator.record.look import Foreseen

#: A charge has shown the pack's capacity once its SOC, in whole percent, has risen by this much.
SHOWN_PCT = 10.0
#: What a charge shows and what the policy says differ by less than this factor, or one of them is wrong.
DISAGREE = 2.0
#: A current that has just begun, or has just got another step, is still on its way.
SETTLED_S = 30.0
#: With less than this current a charge has not begun, or is at its end.
LEAST_A = 0.2
#: A longer estimate is none.
MOST_H = 48.0
SOC = "current.soc_pct"


def foresee(snapshot: Snapshot, memory: Memory, rules: Rules) -> Foreseen | None:
    """How long the charge still takes, for the record; None while no current is asked for."""
    f = Facts.of(memory.last_s or 0.0, snapshot, memory, rules)
    return Foreseen(target(f)[0], bmu_minutes(f), own_minutes(f)) if f.energised else None


def bmu_minutes(f: Facts) -> float | None:
    """What the BMU says, if its object map has it, and current flows."""
    return f.slow(f.snapshot.battery.time_to_full_min) if f.energised else None


def own_minutes(f: Facts) -> float | None:
    """The minutes until the charge is over; None if nothing sensible can be said."""
    end_pct, _ = target(f)
    ah = capacity_ah(f)
    if f.memory.state is not State.CHARGING or ah is None or f.soc is None or f.soc >= end_pct:
        return None
    if f.amps is None or f.amps < LEAST_A or not _settled(f) or tapers(f):
        return None
    hours = 0.0
    for width_pct, allowed_a in _stretches(f, f.soc, end_pct):
        amps = _flows(f, allowed_a)
        if not amps:
            return None  # the policy pauses there, and nobody knows for how long
        hours += width_pct / 100 * ah / amps
    if goes_full(f):
        hours += f.rules.policy.finish.hold_min / 60
    return hours * 60 if hours <= MOST_H else None


def _settled(f: Facts) -> bool:
    """Whether the current has come up to the step: before that it says nothing about the next hour."""
    session, step_s = f.memory.session, f.now_s - f.memory.charger.limit_s if f.rules.manual else SETTLED_S
    return session is not None and min(session.energised_s, step_s) >= SETTLED_S


def capacity_ah(f: Facts) -> float | None:
    """The pack's capacity: as this charge has shown it, else as the policy and the SOH say; None if these disagree."""
    session, rated_ah = f.memory.session, f.rules.policy.pack.capacity_ah
    if rated_ah is not None:
        rated_ah *= (f.soh if f.soh is not None else 100.0) / 100
    if session is None or session.soc_start_pct is None or f.soc is None:
        return rated_ah
    gained_pct = f.soc - session.soc_start_pct
    if gained_pct < SHOWN_PCT or session.charged_ah <= 0:
        return rated_ah
    shown_ah = 100 * session.charged_ah / gained_pct
    agree = rated_ah is None or 1 / DISAGREE <= shown_ah / rated_ah <= DISAGREE
    return shown_ah if agree else None


def _stretches(f: Facts, soc_pct: float, end_pct: float) -> Iterator[tuple[float, float]]:
    """From here to the target: how many percent each, and what is allowed there."""
    others_a = min((one.allowed_a for one in bounds(f, None) if not one.key.startswith(SOC)), default=inf)
    table = next((one for one in f.rules.tables if one.name == "soc_pct"), None)
    if table is None:
        yield end_pct - soc_pct, others_a
        return
    for row, allowed_a in zip(table.rows, table.amps, strict=True):
        width_pct = min(row.to, end_pct) - max(row.from_, soc_pct)
        if width_pct > 0:
            yield width_pct, min(allowed_a, others_a)


def _flows(f: Facts, allowed_a: float) -> float:
    """What the charger will deliver; 0.0 if not even its lowest step is allowed."""
    now_a, step = f.amps or 0.0, f.memory.stage.step
    if step is None:  # it chooses by itself
        return min(now_a, allowed_a)
    index = highest_step(allowed_a, f.rules.worst_a)
    return 0.0 if index is None else f.rules.steps_a[index] * min(now_a / step.current_a, 1.0)
