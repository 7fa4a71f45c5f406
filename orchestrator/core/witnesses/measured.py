"""Volts and amps of charger and BMU side by side, and which of the two is likelier wrong."""

from math import fsum

from orchestrator.config.amperes import volts_differ
from orchestrator.core.cells import chemistry
from orchestrator.core.facts import Facts
from orchestrator.core.witnesses.standby import FROZEN
from orchestrator.model import Cause, ChargeMode

#: A pack under charge may lose this to the vehicle it sits in before it counts as back-feed.
BACK_FEED_A = 0.5
#: Values that stay the same for this long, while the other device's move by twenty times the resolution or more, are no
#: longer measured. The charger's are judged above this current; at rest, by its volts alone.
STILL_S, STILL_ABOVE_A = 60.0, 1.0
MOVED_V, MOVED_A = 0.2, 0.5
#: In these modes a charger may switch its current on and off by itself.
PULSES = (ChargeMode.BATTERY_RECOVERY, ChargeMode.PRECHARGE)
#: A counting BMU must have changed a figure once this share of a whole charge has flowed.
MOVED_SHARE = 0.02


def over_voltage(f: Facts) -> Cause | None:
    """FAULTS C10, B14."""
    limit_v = f.rules.max_v
    if f.volts is not None and f.volts > limit_v:
        return Cause.of("over_voltage_charger", charger_v=f.volts, limit_v=limit_v)
    if f.pack_v is not None and f.pack_v > limit_v:
        return Cause.of("over_voltage_pack", pack_v=f.pack_v, limit_v=limit_v)
    return None


def volts_disagree(f: Facts) -> Cause | None:
    """FAULTS B15."""
    if f.volts is None or f.pack_v is None or not f.connected:
        return None
    volts, pack_v = _steady(f, "charger_v", f.volts), _steady(f, "pack_v", f.pack_v)
    if abs(volts - pack_v) <= volts_differ(f.rules.policy.faults, pack_v):
        return None
    wrong = _likelier_wrong(_fits_soc(f, volts), _fits_soc(f, pack_v), Cause("by_soc"))
    return Cause.of("volts_disagree", charger_v=volts, pack_v=pack_v, wrong=wrong)


def amps_disagree(f: Facts) -> Cause | None:
    """FAULTS B16."""
    if f.amps is None or f.pack_a is None:
        return None
    amps, pack_a = _steady(f, "charger_a", f.amps), _steady(f, "pack_a", f.pack_a)
    tolerance_a = max(f.rules.policy.faults.amps_differ_a, f.rules.policy.faults.amps_differ_pct / 100 * amps)
    if abs(amps - pack_a) <= tolerance_a:
        return None
    step, wrong = f.memory.stage.step, None
    if step is not None:
        charger_fits, bmu_fits = (abs(seen_a - step.current_a) <= tolerance_a for seen_a in (amps, pack_a))
        wrong = _likelier_wrong(charger_fits, bmu_fits, Cause.of("by_step", step_a=step.current_a))
    return Cause.of("amps_disagree", charger_a=amps, pack_a=pack_a, wrong=wrong)


def _steady(f: Facts, name: str, now: float) -> float:
    """The value; while a charger wakes a pack with pulses, its mean over the last seconds.

    Otherwise a BMU that lags by half a pulse would contradict the charger all the time.
    """
    if f.reading is None or f.reading.charge_mode not in PULSES:
        return now
    trail = [getattr(sample, name) for sample in f.memory.witnessed.trail] or [now]
    return fsum(trail) / len(trail)


def _fits_soc(f: Facts, volts: float) -> bool:
    if f.soc is None:
        return True
    low_v, high_v = chemistry(f.rules.policy.pack).bounds_v(f.soc)
    return low_v <= volts / f.rules.policy.pack.cells_in_series <= high_v


def _likelier_wrong(charger_fits: bool, bmu_fits: bool, by: Cause) -> Cause | None:  # noqa: FBT001 - one question's two
    if charger_fits == bmu_fits:
        return None
    return Cause.of("bmu_likelier_wrong" if charger_fits else "charger_likelier_wrong", by=by)


def charger_frozen(f: Facts) -> Cause | None:
    """FAULTS C20: its values stand still while the battery's move.

    Standing still alone proves nothing: a good supply on a flat cell may show the same digits for minutes.
    """
    still = f.memory.charger.still
    if still is None or f.now_s - still.t_s < STILL_S or f.pack_v is None or f.pack_a is None:
        return None
    moved_v, moved_a = abs(f.pack_v - still.pack_v), abs(f.pack_a - still.pack_a)
    if still.amps <= STILL_ABOVE_A or (moved_v <= MOVED_V and moved_a <= MOVED_A):
        return None
    return Cause.of(
        "charger_frozen",
        charger_v=still.volts, charger_a=still.amps, lasted_s=f.now_s - still.t_s, moved_v=moved_v, moved_a=moved_a,
    )  # fmt: skip


def charger_frozen_at_rest(f: Facts) -> Cause | None:
    """FAULTS C31."""
    still = f.memory.charger.still
    if still is None or not f.standby or not f.connected or f.now_s - still.t_s < STILL_S or f.pack_v is None:
        return None
    moved_v = abs(f.pack_v - still.pack_v)
    if moved_v <= MOVED_V or abs(f.pack_v - still.volts) <= MOVED_V:  # it moved to where the charger had been all along
        return None
    lasted_s = f.now_s - still.t_s
    return Cause.of("charger_frozen_at_rest", charger_v=still.volts, lasted_s=lasted_s, moved_v=moved_v)


def bmu_frozen(f: Facts) -> Cause | None:
    """FAULTS B23, the mirror of `charger_frozen`: the BMU's whole report stands still, though a charge goes in."""
    frozen, session = f.memory.witnessed.frozen, f.memory.session
    if frozen is not None and FROZEN in f.raised:
        return Cause.of("bmu_still_frozen", lasted_s=f.now_s - frozen.t_s)
    if frozen is None or session is None or f.volts is None or f.now_s - frozen.t_s < STILL_S:
        return None
    moved_v, moved_ah = abs(f.volts - frozen.charger_v), session.charged_ah - frozen.charged_ah
    if moved_v <= MOVED_V and moved_ah < MOVED_SHARE * f.rules.max_ah:
        return None
    return Cause.of("bmu_frozen", lasted_s=f.now_s - frozen.t_s, moved_v=moved_v, moved_ah=moved_ah)


def back_feed(f: Facts) -> Cause | None:
    """FAULTS C12."""
    if f.memory.charger.runs_s is None or f.pack_a is None or f.pack_a >= -BACK_FEED_A:
        return None
    return Cause.of("back_feed", discharge_a=-f.pack_a)
