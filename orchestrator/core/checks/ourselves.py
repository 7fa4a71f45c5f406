"""Faults of this service, and of the machine that it runs on."""

from orchestrator.core.facts import Facts

#: A bay is looked at every 0.2 s: two ticks late is said, five stop the charge. (A controller that hangs is killed by
#: its guardian before; that much late is a machine that stood still with both.)
LATE_S, OVERRUN_S = 0.4, 1.0
#: While a machine is suspended the clock of all ages stands still: they are too young by that.
SUSPENDED_S = 2.0


def internal(f: Facts) -> str | None:
    """FAULTS G5, P11."""
    return "; ".join(filter(None, (f.snapshot.internal, *f.broken))) or None


def late(f: Facts) -> str | None:
    """FAULTS G6."""
    late_s = f.snapshot.late_s
    return f"this bay was looked at {late_s:.2f} s late" if late_s > LATE_S else None


def overrun(f: Facts) -> str | None:
    """FAULTS G6."""
    late_s = f.snapshot.late_s
    return f"nobody looked at this bay for {late_s:.1f} s: the machine stood still" if late_s > OVERRUN_S else None


def suspended(f: Facts) -> str | None:
    """FAULTS G7."""
    slept_s = f.snapshot.slept_s
    if slept_s <= SUSPENDED_S:
        return None
    return f"the machine was suspended for {slept_s:.0f} s: nothing that is known of this bay holds any more"


def unkept(f: Facts) -> str | None:
    """FAULTS G8: a charge goes on, but none begins of which a latched fault would be forgotten by a restart."""
    return f.snapshot.unkept or None
