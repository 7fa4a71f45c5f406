"""Faults of the charge itself: it takes too long, too much, or leads nowhere."""

from orchestrator.core import limits
from orchestrator.core.facts import Facts
from orchestrator.model import State

#: A charge that begins at this SOC or less may take all that the policy allows; from a higher one it needs less.
SOC_ERROR_PCT = 20.0


def precharge_no_rise(f: Facts) -> str | None:
    """FAULTS C15."""
    rule, session = f.rules.policy.precharge, f.memory.session
    if rule is None or f.pack_v is None or f.memory.state not in (State.PRECHARGE_PULSE, State.PRECHARGE_CONTINUOUS):
        return None
    if session is None or session.rise_v is None:
        return None
    lasted_s, rise_v = session.rise_s, f.pack_v - session.rise_v
    if lasted_s < rule.rise.within_min * 60 or rise_v >= rule.rise.volts:
        return None
    at = f.rules.policy.source.at("precharge.rise")
    return f"the pack rose by {rise_v:.2f} V in {lasted_s / 60:.1f} min, {rule.rise.volts:g} V were expected ({at})"


def precharge_too_long(f: Facts) -> str | None:
    """FAULTS C15."""
    rule, session = f.rules.policy.precharge, f.memory.session
    if rule is None or session is None or f.memory.state is not State.PRECHARGE_CONTINUOUS:
        return None
    if session.continuous_s <= rule.continuous.max_min * 60:
        return None
    at = f.rules.policy.source.at("precharge.continuous.max_min")
    minutes = session.continuous_s / 60
    return f"continuous precharge has taken {minutes:.1f} min and the pack is below {rule.below_v:g} V ({at})"


def no_step_allowed(f: Facts) -> str | None:
    """FAULTS P12: `max_a: 0`, or a charger whose lowest step is too much."""
    return limits.none_allowed(f)


def precharge_too_strong(f: Facts) -> str | None:
    """FAULTS P12: precharge is always on the charger's lowest step."""
    rule, lowest_a = f.rules.policy.precharge, f.rules.worst_a[0]
    if not f.rules.manual or rule is None or f.pack_v is None or f.pack_v >= rule.below_v or lowest_a <= rule.max_a:
        return None
    at = f.rules.policy.source.at("precharge.max_a")
    return (
        f"the pack has {f.pack_v:.2f} V and needs precharge with at most {rule.max_a:g} A ({at}); the lowest step of "
        f"this charger is {lowest_a:g} A"
    )


def time_limit(f: Facts) -> str | None:
    """FAULTS C17."""
    session, hours = f.memory.session, f.rules.max_hours
    if session is None:
        return None
    took_s = session.energised_s + session.unseen_s
    if took_s <= hours * 3600:
        return None
    return f"charging has taken {took_s / 3600:.2f} h ({f.rules.policy.source.at('finish.max_hours')})"


def ah_limit(f: Facts) -> str | None:
    """FAULTS C17."""
    session, max_ah = f.memory.session, f.rules.max_ah
    if session is None:
        return None
    begun_pct = session.soc_start_pct or 0.0
    need = min(1.0, (100.0 - begun_pct + SOC_ERROR_PCT) / 100.0)
    charged_ah = session.charged_ah + session.unseen_s / 3600 * f.rules.bay.limits.current_a
    if charged_ah <= need * max_ah:
        return None
    at = f.rules.policy.source.at("finish.max_ah")
    return (
        f"{charged_ah:.2f} Ah were charged since SOC {begun_pct:.0f} %: a whole charge may take {max_ah:g} Ah "
        f"({at}), so from there {need * max_ah:.2f} Ah"
    )
