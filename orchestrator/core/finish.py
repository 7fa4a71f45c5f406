"""When a charge is over, by the policy. Time and Ah limits are faults and stand in the fault table."""

from orchestrator.core.facts import Facts

#: A charger that ends a charge below this state of charge is wrong, or the BMU is.
EARLY_FULL_PCT = 80.0


def finished(f: Facts) -> str | None:
    """Why the battery is full, with the policy's line; None while it is not."""
    rule, source = f.rules.policy.finish, f.rules.policy.source
    if f.soc is not None and f.soc >= rule.soc_pct:
        return f"SOC {f.soc:.0f} % reached {rule.soc_pct:g} % ({source.at('finish.soc_pct')})"
    if rule.charger_full and f.full_mode and f.soc is not None and f.soc >= early_below_pct(f):
        return f"the charger reports full (mode 5) ({source.at('finish.charger_full')})"
    taper, since_s = rule.taper, f.memory.taper_s
    if taper is not None and since_s is not None and f.now_s - since_s >= taper.for_s:
        return f"{f.amps:.2f} A, tapered below {taper.below_a:g} A for {taper.for_s:g} s ({source.at('finish.taper')})"
    return None


def early_below_pct(f: Facts) -> float:
    """Below this state of charge the charger's own "full" is not believed: the fault table has a row for it."""
    return min(EARLY_FULL_PCT, f.rules.policy.finish.soc_pct)


def tapers(f: Facts) -> bool:
    """The current is low because the pack is nearly full, not because the charge has not begun."""
    taper = f.rules.policy.finish.taper
    if taper is None or f.amps is None or f.pack_v is None or f.memory.runs_s is None:
        return False
    return f.amps < taper.below_a and f.pack_v > taper.above_v
