"""Faults seen only by holding the charger's readings and the BMU's side by side."""

from orchestrator.core.facts import Facts

#: A pack under charge may lose this to the vehicle that it sits in before it counts as back-feed.
BACK_FEED_A = 0.5
#: A charger's values that are the same for this long, at more than this current, while the BMU's have moved by twenty
#: times the resolution or more, are not measured any more.
STILL_S, STILL_ABOVE_A = 60.0, 1.0
MOVED_V, MOVED_A = 0.2, 0.5


def over_voltage(f: Facts) -> str | None:
    """FAULTS C10, B14."""
    limit_v = f.rules.max_v
    if f.volts is not None and f.volts > limit_v:
        return f"{f.volts:.2f} V at the charger, the limit is {limit_v:g} V"
    if f.pack_v is not None and f.pack_v > limit_v:
        return f"{f.pack_v:.2f} V at the pack, the limit is {limit_v:g} V"
    return None


def volts_disagree(f: Facts) -> str | None:
    """FAULTS B15."""
    if f.volts is None or f.pack_v is None or not f.connected:
        return None
    limits = f.rules.policy.faults
    if abs(f.volts - f.pack_v) <= max(limits.volts_differ_v, limits.volts_differ_pct / 100 * f.pack_v):
        return None
    return f"the charger reads {f.volts:.2f} V, the BMU {f.pack_v:.2f} V: not the same battery, or a bad connection"


def amps_disagree(f: Facts) -> str | None:
    """FAULTS B16."""
    if f.amps is None or f.pack_a is None:
        return None
    limits = f.rules.policy.faults
    if abs(f.amps - f.pack_a) <= max(limits.amps_differ_a, limits.amps_differ_pct / 100 * f.amps):
        return None
    return f"the charger reads {f.amps:.2f} A, the BMU {f.pack_a:.2f} A"


def charger_frozen(f: Facts) -> str | None:
    """FAULTS C20: its values stand still, and the battery's do not. Alone the one proves nothing: a good supply on a
    flat cell may show the same digits for minutes."""
    still = f.memory.still
    if still is None or f.now_s - still.t_s < STILL_S or f.pack_v is None or f.pack_a is None:
        return None
    moved_v, moved_a = abs(f.pack_v - still.pack_v), abs(f.pack_a - still.pack_a)
    if moved_v <= MOVED_V and moved_a <= MOVED_A:
        return None
    return (
        f"the charger has said {still.volts:.2f} V and {still.amps:.2f} A for {f.now_s - still.t_s:.0f} s, "
        f"while the BMU's values moved by {moved_v:.2f} V and {moved_a:.2f} A: its measurement is frozen"
    )


def back_feed(f: Facts) -> str | None:
    """FAULTS C12."""
    if f.memory.runs_s is None or f.pack_a is None or f.pack_a >= -BACK_FEED_A:
        return None
    return f"the BMU reports a discharge of {-f.pack_a:.2f} A while the charger runs"
