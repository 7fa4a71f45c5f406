"""Volts and amps of charger and BMU side by side, and which of the two is likelier wrong."""

from statistics import fmean

from orchestrator.config.amperes import volts_differ
from orchestrator.core.cells import chemistry
from orchestrator.core.facts import Facts
from orchestrator.core.witnesses.standby import FROZEN
from orchestrator.model import ChargeMode

#: A pack under charge may lose this to the vehicle that it sits in before it counts as back-feed.
BACK_FEED_A = 0.5
#: Values that are the same for this long, while the other one's have moved by twenty times the resolution or more, are
#: not measured any more. The charger's are judged above this current; at rest by its volts alone.
STILL_S, STILL_ABOVE_A = 60.0, 1.0
MOVED_V, MOVED_A = 0.2, 0.5
#: In these a charger may switch its current on and off by itself.
PULSES = (ChargeMode.BATTERY_RECOVERY, ChargeMode.PRECHARGE)
#: A BMU that counts must have moved a figure when this share of a whole charge has flowed.
MOVED_SHARE = 0.02


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
    volts, pack_v = _steady(f, "charger_v", f.volts), _steady(f, "pack_v", f.pack_v)
    if abs(volts - pack_v) <= volts_differ(f.rules.policy.faults, pack_v):
        return None
    text = f"the charger reads {volts:.2f} V, the BMU {pack_v:.2f} V: not the same battery, or a bad connection"
    return text + _likelier_wrong(_fits_soc(f, volts), _fits_soc(f, pack_v), "the pack's SOC")


def amps_disagree(f: Facts) -> str | None:
    """FAULTS B16."""
    if f.amps is None or f.pack_a is None:
        return None
    amps, pack_a = _steady(f, "charger_a", f.amps), _steady(f, "pack_a", f.pack_a)
    tolerance_a = max(f.rules.policy.faults.amps_differ_a, f.rules.policy.faults.amps_differ_pct / 100 * amps)
    if abs(amps - pack_a) <= tolerance_a:
        return None
    text = f"the charger reads {amps:.2f} A, the BMU {pack_a:.2f} A"
    step = f.memory.step
    if step is None:
        return text
    charger_fits, bmu_fits = (abs(seen_a - step.current_a) <= tolerance_a for seen_a in (amps, pack_a))
    return text + _likelier_wrong(charger_fits, bmu_fits, f"the step that was set ({step.current_a:g} A)")


def _steady(f: Facts, name: str, now: float) -> float:
    """The value; of a charger that wakes a pack with pulses its mean of the last seconds: a BMU that is late by half a
    pulse would else contradict it all the time."""
    if f.reading is None or f.reading.charge_mode not in PULSES:
        return now
    return fmean([getattr(sample, name) for sample in f.memory.witnessed.trail] or [now])


def _fits_soc(f: Facts, volts: float) -> bool:
    if f.soc is None:
        return True
    low_v, high_v = chemistry(f.rules.policy.pack).bounds_v(f.soc)
    return low_v <= volts / f.rules.policy.pack.cells_in_series <= high_v


def _likelier_wrong(charger_fits: bool, bmu_fits: bool, by_what: str) -> str:  # noqa: FBT001 - the two of one question
    if charger_fits == bmu_fits:
        return ""
    return f"; {'the BMU' if charger_fits else 'the charger'} is likelier wrong, by {by_what}"


def charger_frozen(f: Facts) -> str | None:
    """FAULTS C20: its values stand still, and the battery's do not. Alone the one proves nothing: a good supply on a
    flat cell may show the same digits for minutes."""
    still = f.memory.still
    if still is None or f.now_s - still.t_s < STILL_S or f.pack_v is None or f.pack_a is None:
        return None
    moved_v, moved_a = abs(f.pack_v - still.pack_v), abs(f.pack_a - still.pack_a)
    if still.amps <= STILL_ABOVE_A or (moved_v <= MOVED_V and moved_a <= MOVED_A):
        return None
    return (
        f"the charger has said {still.volts:.2f} V and {still.amps:.2f} A for {f.now_s - still.t_s:.0f} s, "
        f"while the BMU's values moved by {moved_v:.2f} V and {moved_a:.2f} A: its measurement is frozen"
    )


def charger_frozen_at_rest(f: Facts) -> str | None:
    """FAULTS C31."""
    still = f.memory.still
    if still is None or not f.standby or not f.connected or f.now_s - still.t_s < STILL_S or f.pack_v is None:
        return None
    moved_v = abs(f.pack_v - still.pack_v)
    if moved_v <= MOVED_V or abs(f.pack_v - still.volts) <= MOVED_V:  # it moved to where the charger had been all along
        return None
    return (
        f"the charger has said {still.volts:.2f} V for {f.now_s - still.t_s:.0f} s at rest, while the BMU's voltage "
        f"moved by {moved_v:.2f} V: its measurement is frozen"
    )


def bmu_frozen(f: Facts) -> str | None:
    """FAULTS B23, the mirror of `charger_frozen`: every word of the BMU stands still, though a charge goes in."""
    frozen, session = f.memory.witnessed.frozen, f.memory.session
    if frozen is not None and FROZEN in f.raised:
        return f"the BMU has said the same in every word for {f.now_s - frozen.t_s:.0f} s: its values are frozen"
    if frozen is None or session is None or f.volts is None or f.now_s - frozen.t_s < STILL_S:
        return None
    moved_v, moved_ah = abs(f.volts - frozen.charger_v), session.charged_ah - frozen.charged_ah
    if moved_v <= MOVED_V and moved_ah < MOVED_SHARE * f.rules.max_ah:
        return None
    return (
        f"the BMU has said the same in every word for {f.now_s - frozen.t_s:.0f} s, while the charger's voltage moved "
        f"by {moved_v:.2f} V and {moved_ah:.2f} Ah went in: its values are frozen"
    )


def back_feed(f: Facts) -> str | None:
    """FAULTS C12."""
    if f.memory.runs_s is None or f.pack_a is None or f.pack_a >= -BACK_FEED_A:
        return None
    return f"the BMU reports a discharge of {-f.pack_a:.2f} A while the charger runs"
