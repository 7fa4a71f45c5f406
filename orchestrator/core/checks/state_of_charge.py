"""Faults of what the BMU computes rather than measures: SOC, remaining capacity and energy, times to full and to empty.

Each alone may be a BMU that has corrected itself, so it only warns; two together are believed.
"""

from orchestrator.core.facts import TERMINAL_V, Facts
from orchestrator.core.memory import Memory
from orchestrator.model import Cause

#: From one reading to the next the SOC may take a step of this much, plus what a tiny pack takes in each second.
SOC_STEP_PCT, SOC_RATE_PCT_PER_S = 5.0, 1.0
#: Across a gap too long to be watched it may have been corrected by this much, and have moved by 2 % a minute.
SOC_OTHER_PCT, SOC_DRIFT_PCT_PER_S = 10.0, 2.0 / 60
#: A step is news for as long as a second doubt may take to show; an exchange until it can be answered.
STEP_NEWS_S, EXCHANGE_NEWS_S = 900.0, 5.0
#: A SOC that has stayed this far below its highest value for this long under charge is falling.
FALLING_S, FALLING_PCT = 900.0, 2.0
#: Energy is capacity times voltage, and the missing charge is current times time to full, up to these factors. The BMU
#: smooths its current over minutes and knows what the last cells take.
ENERGY_FACTOR, CAPACITY_FACTOR = 1.5, 3.0
#: Below these nothing is compared: the figures are too coarse.
LEAST_AH, LEAST_SOC_PCT, LEAST_A = 1.0, 10.0, 1.0
#: The cause of an exchange that a serial number proves.
OTHER_SERIAL = "other_serial"
#: Faults that are only doubts when alone.
DOUBTS = ("soc_jump", "soc_falls", "figures_disagree")


def soc_jump(f: Facts) -> Cause | None:
    """FAULTS B17."""
    step = f.memory.battery.charge_step
    return step[1] if step is not None and f.now_s - step[0] < STEP_NEWS_S else None


def jump_ends_s(memory: Memory) -> float | None:
    """When a jump stops being news."""
    step = memory.battery.charge_step
    return step[0] + STEP_NEWS_S if step is not None else None


def soc_falls(f: Facts) -> Cause | None:
    """FAULTS B17."""
    peak = f.memory.battery.peak
    if peak is None or f.soc is None or f.now_s - peak[0] < FALLING_S or peak[1] - f.soc < FALLING_PCT:
        return None
    return Cause.of("soc_falls", peak_pct=peak[1], soc_pct=f.soc, passed_min=(f.now_s - peak[0]) / 60)


def figures_disagree(f: Facts) -> Cause | None:
    """FAULTS B17: remaining capacity, available energy, SOC and time to full of one pack, which must be consistent."""
    battery = f.snapshot.battery
    if battery.remaining_ah is None or f.soc is None or f.pack_v is None or f.pack_a is None:
        return None
    ah = f.slow(battery.remaining_ah)
    if ah is None or ah < LEAST_AH or f.pack_v < TERMINAL_V:
        return None
    wh = f.slow(battery.available_wh)
    if wh is not None and not 1 / ENERGY_FACTOR <= wh / (ah * f.pack_v) <= ENERGY_FACTOR:
        return Cause.of("energy_disagrees", remaining_ah=ah, available_wh=wh, implied_v=wh / ah, pack_v=f.pack_v)
    minutes = f.slow(battery.time_to_full_min)
    if minutes is None or f.soc < LEAST_SOC_PCT or f.pack_a < LEAST_A:
        return None
    missing_ah, takes_ah = ah * (100 - f.soc) / f.soc, f.pack_a * minutes / 60
    if min(missing_ah, takes_ah) < LEAST_AH or 1 / CAPACITY_FACTOR <= takes_ah / missing_ah <= CAPACITY_FACTOR:
        return None
    return Cause.of(
        "time_to_full_disagrees",
        full_min=minutes, takes_ah=takes_ah, remaining_ah=ah, soc_pct=f.soc, missing_ah=missing_ah,
    )  # fmt: skip


def soc_not_believed(f: Facts) -> Cause | None:
    """FAULTS B17: two doubts at once."""
    doubts = [name for name in DOUBTS if name in f.raised]
    if len(doubts) < 2:
        return None
    seen = [f.memory.faults[name] for name in doubts]
    return Cause.of("soc_not_believed", whats=tuple(doubt.now or doubt.cause for doubt in seen))


def exchange_ends_s(memory: Memory) -> float | None:
    """When an exchange stops being news."""
    exchange = memory.battery.exchange
    return exchange[0] + EXCHANGE_NEWS_S if exchange is not None else None


def battery_exchanged(f: Facts) -> Cause | None:
    """FAULTS B18: the charger never saw the battery leave, and the BMU that answers again reports another one."""
    exchange = f.memory.battery.exchange
    if exchange is None or f.now_s - exchange[0] >= EXCHANGE_NEWS_S:
        return None
    what = exchange[1]
    return what if what.id == OTHER_SERIAL else Cause.of("battery_exchanged", what=what)
