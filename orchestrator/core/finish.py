"""When a charge is over, by the policy. Time and Ah limits are faults and are in the fault table.

A charge goes to the policy's target, or all the way: with a target of 100 %, and once every `full_every_days`. The pack
shows what all the way is: its current has tapered off at the end voltage, the charger reports full after a taper, or
the BMU's SOC if the policy trusts it. Then it may stay on charge for a while to balance.
"""

from orchestrator.config.amperes import END_SHARE, end_v
from orchestrator.config.policy import Needs
from orchestrator.core.facts import Facts
from orchestrator.core.memory import Operator
from orchestrator.model import Cause

#: If a charger ends a charge below this state of charge, it is wrong, or the BMU is.
EARLY_FULL_PCT = 80.0
#: A current below this share of the current step has tapered off.
TAPERED_SHARE = 0.5
#: A current that has just begun is low, too: it must have flowed for this long.
SEEN_TAPER_S = 5.0
#: A pack that was found full and has lost this much is no longer full.
FALLEN_PCT = 3.0
DAY_S = 86400.0


def finished(f: Facts) -> Cause | None:
    """Why the charge is over, with the policy's line; None while it is not."""
    rule, by_policy = f.rules.policy.finish, f.rules.by_policy
    target_pct, key = target(f)
    if target_pct < 100 and f.soc is not None and f.soc >= target_pct:
        if (what := once(f.memory.operator)) is not None:
            return Cause.of("once_reached", soc_pct=f.soc, target_pct=target_pct, what=what)
        return by_policy("full_soc", key, soc_pct=f.soc, limit_pct=target_pct)
    ended = ends_hold(f) or _by_charger(f)
    if ended is not None:
        return ended
    session = f.memory.session
    full = known_full(f) if session is None else session.full
    if not full or session is None or not goes_full(f):  # with a lower target nothing is held
        return full
    if session.held_s < rule.hold_min * 60:
        return None
    return by_policy("full_held", "finish.hold_min", what=full, hold_min=rule.hold_min) if rule.hold_min else full


def ends_hold(f: Facts) -> Cause | None:
    """The sign by which the pack was found full, once the charger ends the hold at the top by itself."""
    session = f.memory.session
    return session.full if session is not None and f.full_mode else None


def known_full(f: Facts) -> Cause | None:
    """The sign by which the pack is known to be full now; None while it is not."""
    rule = f.rules.policy.finish.full
    if rule.needs is Needs.ANY:
        return _by_soc(f) or _by_taper(f) or _by_charger(f)
    needed = [sign(f) for name, sign in SIGNS.items() if getattr(rule, name) not in (None, False)]
    seen = [sign for sign in needed if sign is not None]
    if not seen or len(seen) < len(needed):
        return None
    return seen[0] if len(seen) == 1 else Cause.of("full_by_all", whats=tuple(seen))


def _by_soc(f: Facts) -> Cause | None:
    full_pct = f.rules.policy.finish.full.soc_pct
    if full_pct is None or f.soc is None or f.soc < max(full_pct, f.memory.operator.target_pct or 0.0):
        return None
    return f.rules.by_policy("full_soc", "finish.full.soc_pct", soc_pct=f.soc, limit_pct=full_pct)


def _by_taper(f: Facts) -> Cause | None:
    taper, since_s = f.rules.taper, f.memory.stage.taper_s
    if taper is None or since_s is None or f.amps is None or f.now_s - since_s < taper.for_s:
        return None
    key, below_a = "finish.full.taper", tapered_a(f)
    return f.rules.by_policy("full_taper", key, charger_a=f.amps, below_a=below_a, for_s=taper.for_s)


def _by_charger(f: Facts) -> Cause | None:
    """A charger that ends an honest charge by itself has ended it, whatever else is needed to call the pack full."""
    if f.rules.policy.finish.full.charger is False or not f.full_mode or f.soc is None:
        return None
    if f.soc < early_below_pct(f) or not ends_full(f):
        return None
    return f.rules.by_policy("full_charger", "finish.full.charger")


#: Each sign of a full pack by its key in the policy.
SIGNS = {"soc_pct": _by_soc, "taper": _by_taper, "charger": _by_charger}


def ends_full(f: Facts) -> bool:
    """Whether the charger's end looks like full: the current had tapered off, or the pack was at its end voltage.

    A charger that somebody stopped by other means also shows mode 5.
    """
    pack, trail = f.rules.policy.pack, f.memory.witnessed.trail
    full_v = f.rules.taper.above_v if f.rules.taper is not None else END_SHARE * end_v(pack)
    if max((sample.pack_v for sample in trail), default=f.pack_v or 0.0) >= full_v:
        return True
    flowed = [sample for sample in trail if sample.charger_a > 0]
    if not flowed or flowed[-1].t_s - flowed[0].t_s < SEEN_TAPER_S:
        return False
    step = f.memory.stage.step
    set_a = step.current_a if step is not None else max(sample.charger_a for sample in flowed)
    return flowed[-1].charger_a < TAPERED_SHARE * set_a


def early_below_pct(f: Facts) -> float:
    """Below this state of charge the charger's own "full" is not believed: the fault table has a row for it."""
    return min(EARLY_FULL_PCT, f.rules.policy.finish.target_soc_pct)


def tapered_a(f: Facts) -> float:
    """Below this the current has tapered off; on a low step, whose own current is as low, only well below that."""
    below_a = f.rules.taper.below_a if f.rules.taper is not None else 0.0
    return min(below_a, TAPERED_SHARE * f.memory.stage.step.current_a) if f.memory.stage.step is not None else below_a


def tapers(f: Facts) -> bool:
    """The current is low because the pack is nearly full, not because the charge has not begun."""
    taper = f.rules.taper
    if taper is None or f.amps is None or f.pack_v is None or not f.runs:
        return False
    return f.amps < tapered_a(f) and f.pack_v > taper.above_v


# --- all the way, every `full_every_days` -----------------------------------------------------------------------------


def full_due(f: Facts) -> bool:
    """The battery was last charged all the way longer ago than the policy allows."""
    days, full_s = f.rules.policy.finish.full_every_days, f.memory.battery.full_s
    return days is not None and full_s is not None and f.now_s - full_s >= days * DAY_S


def waits_a_day(f: Facts, full_s: float | None) -> float | None:
    """When it was charged all the way; after a charge to a lower target, a full one that is due waits for a day."""
    days = f.rules.policy.finish.full_every_days
    if f.memory.operator.target_pct is None or days is None or full_s is None:
        return full_s
    return max(full_s, f.now_s - days * DAY_S + DAY_S)


def goes_full(f: Facts) -> bool:
    """Whether this charge goes all the way."""
    return target(f)[0] >= 100


def target(f: Facts) -> tuple[float, str]:
    """The target state of charge, and the key that sets it; no key if a person has asked for it once."""
    asked_pct = f.memory.operator.target_pct
    if asked_pct is not None:
        return asked_pct, ""
    if full_due(f):
        return 100.0, "finish.full_every_days"
    return f.rules.policy.finish.target_soc_pct, "finish.target_soc_pct"


def once(known: Operator) -> Cause | None:
    """That one charge goes to a target whatever the policy says, and who has asked for that; None if nobody has."""
    if known.target_pct is None:
        return None
    by = known.target_by
    if by is None:
        return Cause.of("charges_once", target_pct=known.target_pct)
    asked = tuple(one for one in by.params if one[0] in ("who", "asked_unix_s", "because"))
    return Cause("charges_once_by", (("target_pct", known.target_pct), *asked))


def goes_on(f: Facts) -> Cause | None:
    """Why a charge interrupted on its way to full goes on, whatever its SOC; None if the SOC decides."""
    rule, session = f.rules.policy.finish, f.memory.session
    if session is None or not goes_full(f):
        return None
    if session.full and session.held_s < rule.hold_min * 60:
        return f.rules.by_policy("not_held_yet", "finish.hold_min", hold_min=rule.hold_min)
    if not session.full and rule.full.soc_pct is None:
        return f.rules.by_policy("not_known_full", "finish.full")
    return None
