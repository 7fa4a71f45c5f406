"""Faults of this service and of the machine that it runs on."""

from orchestrator.core.facts import Facts
from orchestrator.model import Cause

#: A bay is looked at every 0.2 s: two ticks late is reported, five stop the charge. (A controller that hangs is killed
#: earlier by its guardian; being that late means the machine stood still with both.)
LATE_S, OVERRUN_S = 0.4, 1.0
#: While a machine is suspended the clock behind all ages stands still: they come out too young by that much.
SUSPENDED_S = 2.0


def internal(f: Facts) -> Cause | None:
    """FAULTS G5, P11."""
    if not f.snapshot.internal and not f.broken:
        return None
    said = Cause.of("internal_error", error=f.snapshot.internal)
    return Cause.of("internal", whats=(said, *f.broken) if f.snapshot.internal else f.broken)


def late(f: Facts) -> Cause | None:
    """FAULTS G6."""
    late_s = f.snapshot.late_s
    return Cause.of("late", late_s=late_s) if late_s > LATE_S else None


def overrun(f: Facts) -> Cause | None:
    """FAULTS G6."""
    late_s = f.snapshot.late_s
    return Cause.of("overrun", late_s=late_s) if late_s > OVERRUN_S else None


def suspended(f: Facts) -> Cause | None:
    """FAULTS G7."""
    slept_s = f.snapshot.slept_s
    if slept_s <= SUSPENDED_S:
        return None
    return Cause.of("suspended", slept_s=slept_s)


def not_persisted(f: Facts) -> Cause | None:
    """FAULTS G8: a charge continues, but none begins while a restart would forget its latched faults."""
    return f.snapshot.not_persisted


def supply_failed(f: Facts) -> Cause | None:
    """FAULTS G11: what was granted and verified stays, and nothing more is granted."""
    return f.snapshot.supply_problem
