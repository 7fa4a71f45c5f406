"""Faults of the charge itself: it takes too long or too much, or gets nowhere."""

from orchestrator.core import limits
from orchestrator.core.facts import Facts
from orchestrator.core.states import PRECHARGING
from orchestrator.model import Cause, State

#: A charge that begins at this SOC or below may take all that the policy allows; from a higher one it needs less.
SOC_ERROR_PCT = 20.0


def precharge_no_rise(f: Facts) -> Cause | None:
    """FAULTS C15."""
    rule, session = f.rules.policy.precharge, f.memory.session
    if rule is None or f.pack_v is None or f.memory.state not in PRECHARGING:
        return None
    if session is None or session.rise_v is None:
        return None
    lasted_s, rise_v = session.rise_s, f.pack_v - session.rise_v
    if lasted_s < rule.rise.within_min * 60 or rise_v >= rule.rise.volts:
        return None
    return f.rules.by_policy(
        "precharge_no_rise", "precharge.rise", rise_v=rise_v, lasted_min=lasted_s / 60, expected_v=rule.rise.volts
    )


def precharge_too_long(f: Facts) -> Cause | None:
    """FAULTS C15."""
    rule, session = f.rules.policy.precharge, f.memory.session
    if rule is None or session is None or f.memory.state is not State.PRECHARGE_CONTINUOUS:
        return None
    if session.continuous_s <= rule.continuous.max_min * 60:
        return None
    key, minutes = "precharge.continuous.max_min", session.continuous_s / 60
    return f.rules.by_policy("precharge_too_long", key, lasted_min=minutes, below_v=rule.below_v)


def no_step_allowed(f: Facts) -> Cause | None:
    """FAULTS P12: `max_a: 0`, or a charger whose lowest step is too high."""
    return limits.none_allowed(f)


def precharge_too_strong(f: Facts) -> Cause | None:
    """FAULTS P12: precharge always uses the charger's lowest step."""
    rule, lowest_a = f.rules.policy.precharge, f.rules.worst_a[0]
    if not f.rules.manual or rule is None or f.pack_v is None or f.pack_v >= rule.below_v or lowest_a <= rule.max_a:
        return None
    key = "precharge.max_a"
    return f.rules.by_policy("precharge_too_strong", key, pack_v=f.pack_v, max_a=rule.max_a, lowest_a=lowest_a)


def time_limit(f: Facts) -> Cause | None:
    """FAULTS C17."""
    session, hours = f.memory.session, f.rules.max_hours
    if session is None:
        return None
    took_s = session.energised_s + session.unseen_s
    if took_s <= hours * 3600:
        return None
    return f.rules.by_policy("time_limit", "finish.max_hours", lasted_h=took_s / 3600, limit_h=hours)


def ah_limit(f: Facts) -> Cause | None:
    """FAULTS C17."""
    session, max_ah = f.memory.session, f.rules.max_ah
    if session is None:
        return None
    begun_pct = session.soc_start_pct or 0.0
    need = min(1.0, (100.0 - begun_pct + SOC_ERROR_PCT) / 100.0)
    charged_ah = session.charged_ah + session.unseen_s / 3600 * f.rules.bay.limits.current_a
    if charged_ah <= need * max_ah:
        return None
    return f.rules.by_policy(
        "ah_limit", "finish.max_ah",
        charged_ah=charged_ah, begun_pct=begun_pct, whole_ah=max_ah, limit_ah=need * max_ah,
    )  # fmt: skip
