"""When a charge is over, by the policy. Time and Ah limits are faults and stand in the fault table."""

from orchestrator.core.facts import Facts
from orchestrator.model import Cause

#: A charger that ends a charge below this state of charge is wrong, or the BMU is.
EARLY_FULL_PCT = 80.0
#: Where a policy says nothing else, a full pack has this share of its highest voltage.
END_SHARE = 0.97
#: Less than this share of what was set is a current that has tapered off.
TAPERED_SHARE = 0.5
#: A current that has just begun is low, too: it must have flowed for this long.
SEEN_TAPER_S = 5.0


def finished(f: Facts) -> Cause | None:
    """Why the battery is full, with the policy's line; None while it is not."""
    rule, by_policy = f.rules.policy.finish, f.rules.by_policy
    if f.soc is not None and f.soc >= rule.soc_pct:
        return by_policy("full_soc", "finish.soc_pct", soc_pct=f.soc, limit_pct=rule.soc_pct)
    if rule.charger_full and f.full_mode and f.soc is not None and f.soc >= early_below_pct(f) and ends_full(f):
        return by_policy("full_charger", "finish.charger_full")
    taper, since_s = rule.taper, f.memory.taper_s
    if taper is not None and since_s is not None and f.now_s - since_s >= taper.for_s:
        return by_policy("full_taper", "finish.taper", charger_a=f.amps, below_a=taper.below_a, for_s=taper.for_s)
    return None


def ends_full(f: Facts) -> bool:
    """What led to the charger's end looks like full: the current had tapered off, or the pack was at its end voltage.

    Mode 5 is also what a charger shows that somebody has stopped by other means.
    """
    rule, high_v, trail = f.rules.policy.finish, f.rules.policy.pack.voltage_v.high, f.memory.witnessed.trail
    end_v = rule.taper.above_v if rule.taper is not None else END_SHARE * high_v
    if max((sample.pack_v for sample in trail), default=f.pack_v or 0.0) >= end_v:
        return True
    flowed = [sample for sample in trail if sample.charger_a > 0]
    if not flowed or flowed[-1].t_s - flowed[0].t_s < SEEN_TAPER_S:
        return False
    set_a = f.memory.step.current_a if f.memory.step is not None else max(sample.charger_a for sample in flowed)
    return flowed[-1].charger_a < TAPERED_SHARE * set_a


def early_below_pct(f: Facts) -> float:
    """Below this state of charge the charger's own "full" is not believed: the fault table has a row for it."""
    return min(EARLY_FULL_PCT, f.rules.policy.finish.soc_pct)


def tapers(f: Facts) -> bool:
    """The current is low because the pack is nearly full, not because the charge has not begun."""
    taper = f.rules.policy.finish.taper
    if taper is None or f.amps is None or f.pack_v is None or f.memory.runs_s is None:
        return False
    return f.amps < taper.below_a and f.pack_v > taper.above_v
