"""What the bay's battery has reported until now: makes the next `BatteryHistory`."""

from collections.abc import Mapping
from typing import Any

from orchestrator.core.checks.battery import WARMING_S
from orchestrator.core.checks.state_of_charge import (
    SOC_DRIFT_PCT_PER_S,
    SOC_OTHER_PCT,
    SOC_RATE_PCT_PER_S,
    SOC_STEP_PCT,
)
from orchestrator.core.facts import SLOW_STALE_S, Facts
from orchestrator.core.finish import waits_a_day
from orchestrator.core.history import same_battery
from orchestrator.core.history.same_battery import OTHER_V_SHARE
from orchestrator.core.memory import BatteryHistory
from orchestrator.core.parts import changed
from orchestrator.core.witnesses.measured import STILL_ABOVE_A
from orchestrator.model import Cause, State

#: The interval between the stored temperatures.
WARMTH_EVERY_S = 10.0
#: A battery that is removed in mid-charge and back within this was not taken away: its plug is loose.
LOOSE_PLUG_S = 60.0

Warmth = tuple[tuple[float, float], ...]  #: (t_s, °C), oldest first
Steps = Mapping[str, Any]  #: at most one: `charge_step` or `exchange`


def update(f: Facts) -> BatteryHistory:
    """The history after these facts."""
    known = _departure(f, f.memory.battery)
    charge, step = _charge(f, known)
    sample, sample_before, warmth = known.sample, known.sample_before, known.warmth
    newest = f.snapshot.battery.temperature_c
    if newest is None or f.temperature_c is None:  # after a silence it may be another battery: nothing is compared
        sample, sample_before, warmth = None, None, ()
    elif sample is None or (newest.t_s, newest.value) != sample:
        sample, sample_before = (newest.t_s, newest.value), sample
        warmth = thinned(warmth, sample)
    peak = _peak(f)
    if charge is not known.charge or sample is not known.sample or peak != known.peak:
        known = changed(
            known, charge=charge, peak=peak, sample=sample, sample_before=sample_before, warmth=warmth, **step
        )
    return _known(f, known)


def _departure(f: Facts, known: BatteryHistory) -> BatteryHistory:
    """Detect a loose plug: the battery is removed in mid-charge and back within `LOOSE_PLUG_S`."""
    if known.returned_s is not None:
        known = changed(known, returned_s=None)
    if f.battery_removed:
        session, volts = f.memory.session, f.snapshot.battery.voltage_v
        if session is not None and known.left_s is None:
            left_as = (session.soc_pct, volts.value if volts is not None else None)
            return changed(known, left_s=f.now_s, left_as=left_as)
    elif known.left_s is not None and f.battery.online and f.soc is not None and f.pack_v is not None:
        loose = f.now_s - known.left_s < LOOSE_PLUG_S and not _is_another(f)
        return changed(known, returned_s=f.now_s if loose else None, left_s=None)
    return known


def _is_another(f: Facts) -> bool:
    """Whether SOC or volts show another battery than the one removed; with a loose plug they continue."""
    left_pct, left_v = f.memory.battery.left_as
    by_soc = left_pct is not None and f.soc is not None and abs(f.soc - left_pct) > SOC_OTHER_PCT
    by_volts = left_v is not None and f.pack_v is not None and abs(f.pack_v - left_v) > OTHER_V_SHARE * left_v
    return by_soc or by_volts


def _charge(f: Facts, known: BatteryHistory) -> tuple[tuple[float, float | None], Steps]:
    """The newest SOC, and its step since the previous one if no charge explains that.

    A battery that was seen to leave, or whose BMU boots, is forgotten: the next one is qualified as another.
    """
    newest, charge = f.snapshot.battery.soc_pct, known.charge
    if f.battery_removed or known.boots != f.battery.boots:
        charge = (f.now_s, None)
    before_s, before_pct = charge
    if newest is None or f.soc is None or newest.t_s <= before_s:
        return charge, {}
    charge = (newest.t_s, f.soc)
    if before_pct is None:
        return charge, {}
    gap_s, step_pct = newest.t_s - before_s, abs(f.soc - before_pct)
    watched = gap_s <= SLOW_STALE_S
    usual_pct = SOC_STEP_PCT + SOC_RATE_PCT_PER_S * gap_s if watched else SOC_OTHER_PCT + SOC_DRIFT_PCT_PER_S * gap_s
    if step_pct <= usual_pct:
        return charge, {}
    cause = Cause.of("soc_step", before_pct=before_pct, soc_pct=f.soc, passed_s=gap_s)
    return charge, {"charge_step" if watched else "exchange": (f.now_s, cause)}


def _peak(f: Facts) -> tuple[float, float] | None:
    """The highest SOC while current flows."""
    if f.soc is None or f.pack_a is None or f.pack_a <= STILL_ABOVE_A or not f.energised:
        return None
    peak = f.memory.battery.peak
    return peak if peak is not None and f.soc < peak[1] else (f.now_s, f.soc)


def thinned(warmth: Warmth, sample: tuple[float, float]) -> Warmth:
    """The temperatures of the last minutes with this one, if it is due, for the rate of warming."""
    if warmth and sample[0] - warmth[-1][0] < WARMTH_EVERY_S:
        return warmth
    return (*(kept for kept in warmth if sample[0] - kept[0] <= WARMING_S + WARMTH_EVERY_S), sample)


def _known(f: Facts, known: BatteryHistory) -> BatteryHistory:
    """What is known of the battery itself; another one returns as an unknown one."""
    known = same_battery.recognised(f, known)
    if f.energised:
        return known
    if known.full_s is None and f.soc is not None:
        known = changed(known, full_s=f.now_s)
    known = same_battery.watched(f, known)
    if known.boots != f.battery.boots and f.memory.state is not State.STOPPING:
        known = changed(known, boots=f.battery.boots)
    return known


def charged_full(f: Facts, *, all_the_way: bool) -> BatteryHistory:
    """The history after a charge that ended as it should."""
    known = f.memory.battery
    return changed(known, full_pct=f.soc, full_s=f.now_s if all_the_way else waits_a_day(f, known.full_s))


def begins(known: BatteryHistory) -> BatteryHistory:
    """The history when a charge of this battery begins."""
    return changed(known, full_pct=None) if known.full_pct is not None else known
