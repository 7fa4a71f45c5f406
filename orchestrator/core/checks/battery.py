"""Faults of the battery and of its BMU."""

from orchestrator.core.facts import Facts
from orchestrator.core.witnesses.pack import another_pack
from orchestrator.model import BatteryStatus

#: Hysteresis of the pauses for heat and for cold.
HEAT_HYSTERESIS_K = 5.0
COLD_HYSTERESIS_K = 3.0
#: No pack warms or cools this fast within a second; a sensor that says so is broken.
JUMP_K = 5.0
#: The rate of warming is judged over this long.
WARMING_S = 180.0
#: Heartbeats are missed after so many of their periods: of a node that answers nothing else, and of one that does.
SILENT_PERIODS, ANSWERING_PERIODS = 2.5, 4.5
#: SDO abort codes (upper half) that say: the object is not there, or not like this. The others may pass.
REFUSALS = frozenset({0x0601, 0x0602, 0x0604, 0x0606, 0x0607, 0x0609})
#: What somebody else did on the bus is news for this long.
NEWS_S = 10.0
#: NMT states as a heartbeat tells them (CiA 301).
OPERATIONAL = 0x05
NMT_NAMES = {0x00: "boot-up", 0x04: "stopped", 0x7F: "pre-operational"}
#: Bits that end a charge, and bits that make it gentle. Low voltage is what a deeply discharged pack reports.
STATUS_TRIPS = (
    BatteryStatus.OVER_VOLTAGE,
    BatteryStatus.CHARGE_OVER_CURRENT,
    BatteryStatus.HIGH_TEMPERATURE,
    BatteryStatus.BMU_ERROR,
)
STATUS_LIMITS = (BatteryStatus.LOW_TEMPERATURE, BatteryStatus.DISCHARGE_OVER_CURRENT)


def bmu_silent(f: Facts) -> str | None:
    """FAULTS B1, B5, B19, B21: no values, or a line or a node of which the values cannot be trusted."""
    if (f.battery.online and not f.silent) or f.just_booted:
        return None
    return f.battery.problem or f"the BMU (node 0x{f.rules.bay.battery.node_id:02X}) has stopped answering"


def stale_reading(f: Facts) -> str | None:
    """FAULTS B2: it answers, but not about everything that a charge needs."""
    if f.silent or f.present:
        return None
    return f"no fresh {f.missing} from the BMU"


def sdo_refused(f: Facts) -> str | None:
    """FAULTS B3: the object is not there, or not like this."""
    return f.battery.abort if f.battery.abort and f.battery.abort_code >> 16 in REFUSALS else None


def sdo_aborted(f: Facts) -> str | None:
    """FAULTS B4: the BMU cannot answer now."""
    return f.battery.abort if f.battery.abort and f.battery.abort_code >> 16 not in REFUSALS else None


def heartbeat_lost(f: Facts) -> str | None:
    """FAULTS B6. A node that answers is alive, and a poor bus loses two heartbeats in a row several times a day."""
    link, volts = f.battery, f.snapshot.battery.voltage_v
    if link.heartbeat_s is None or link.heartbeat_t_s is None:
        return None
    age_s = f.now_s - link.heartbeat_t_s
    answered_s = volts.t_s if volts is not None else link.heartbeat_t_s
    silent = f.now_s - answered_s > SILENT_PERIODS * link.heartbeat_s
    allowed = SILENT_PERIODS if silent else ANSWERING_PERIODS
    return f"no heartbeat of the BMU for {age_s:.1f} s" if age_s > allowed * link.heartbeat_s else None


def not_operational(f: Facts) -> str | None:
    """FAULTS B8: only heartbeats tell the state, and only TPDOs need it; SDO reads go on meanwhile."""
    link = f.battery
    if f.rules.bay.battery.tpdo_s is None or link.heartbeat_s is None or link.nmt_state in (None, OPERATIONAL):
        return None
    name = NMT_NAMES.get(link.nmt_state, f"0x{link.nmt_state:02X}")
    return f"the BMU's NMT state is {name}, not operational: it sends no TPDOs, and does not obey an NMT start"


def bmu_rebooted(f: Facts) -> str | None:
    """FAULTS B7."""
    return "the BMU has booted while charging: it must be qualified anew" if f.battery.boots != f.memory.boots else None


def status_trip(f: Facts) -> str | None:
    """FAULTS B9."""
    return _status(f, STATUS_TRIPS)


def status_limit(f: Facts) -> str | None:
    """FAULTS B9, the mild bits."""
    return _status(f, STATUS_LIMITS)


def _status(f: Facts, bits: tuple[BatteryStatus, ...]) -> str | None:
    if not f.status:
        return None
    word = int(f.status)
    names = [bit.name.lower().replace("_", " ") for bit in bits if word >> bit & 1]
    return f"the BMU reports {', '.join(names)} (status word 0x{word:04X})" if names else None


def emergency(f: Facts) -> str | None:
    """FAULTS B9."""
    return f.battery.emergency or None


def over_temperature(f: Facts) -> str | None:
    """FAULTS B10."""
    high = f.rules.temperature_c.high
    again = high - HEAT_HYSTERESIS_K
    if f.temperature_c is None or f.temperature_c < (again if "over_temperature" in f.raised else high):
        return None
    limit = f"the limit is {high:g} °C ({f.rules.hottest_at})"
    return f"the pack has {f.temperature_c:.1f} °C, {limit}; it charges again below {again:g} °C"


def hot_trip(f: Facts) -> str | None:
    """FAULTS B10, where cooling down is not enough."""
    policy = f.rules.policy
    limit = policy.faults.temperature_trip_c
    if f.temperature_c is None or f.temperature_c < limit:
        return None
    at = policy.source.at("faults.temperature_trip_c")
    return f"the pack has {f.temperature_c:.1f} °C, at or above {limit:g} °C ({at})"


def under_temperature(f: Facts) -> str | None:
    """FAULTS B11."""
    low = f.rules.temperature_c.low
    again = low + COLD_HYSTERESIS_K
    if f.temperature_c is None or f.temperature_c >= (again if "under_temperature" in f.raised else low):
        return None
    limit = f"the limit is {low:g} °C ({f.rules.coldest_at})"
    return f"the pack has {f.temperature_c:.1f} °C, {limit}; it charges again at {again:g} °C"


def runaway(f: Facts) -> str | None:
    """FAULTS B12."""
    if f.temperature_c is None or not f.memory.warmth:
        return None
    t_s, then_c = f.memory.warmth[0]
    lasted_s = f.now_s - t_s
    if lasted_s < WARMING_S:
        return None
    rate = (f.temperature_c - then_c) / lasted_s * 60
    limit = f.rules.policy.faults.temperature_rise_k_per_min
    return f"the pack warms by {rate:.2f} K/min, more than {limit:g} K/min" if rate > limit else None


def temperature_invalid(f: Facts) -> str | None:
    """FAULTS B13."""
    if f.just_booted:
        return None
    wrong = f.battery.implausible.get("temperature_c")
    if wrong:
        return wrong
    if f.memory.sample is None or f.memory.sample_before is None:
        return None
    (before_s, before_c), (newest_s, newest_c) = f.memory.sample_before, f.memory.sample
    passed_s = newest_s - before_s
    if abs(newest_c - before_c) <= JUMP_K * max(passed_s, 1.0):
        return None
    return f"the pack's temperature went from {before_c:.1f} to {newest_c:.1f} °C in {passed_s:.2f} s"


def implausible(f: Facts) -> str | None:
    """FAULTS B14, B17: a value that cannot be."""
    if not f.battery.implausible or f.just_booted:
        return None
    texts = [text for name, text in f.battery.implausible.items() if name != "temperature_c"]
    return "; ".join(texts) or None


def under_voltage(f: Facts) -> str | None:
    """FAULTS B14: below what may be woken."""
    pack, source = f.rules.policy.pack, f.rules.policy.source
    if f.pack_v is None or f.pack_v >= pack.voltage_v.low or another_pack(f) is not None:
        return None
    return f"the pack has {f.pack_v:.2f} V, below {pack.voltage_v.low:g} V ({source.at('pack.voltage_v')})"


def needs_precharge(f: Facts) -> str | None:
    """A pack that the policy has no way to wake."""
    policy = f.rules.policy
    if policy.precharge is not None or f.status is None or not int(f.status) >> BatteryStatus.LOW_VOLTAGE & 1:
        return None
    return "the BMU reports low voltage and the policy has no precharge"


def soh_low(f: Facts) -> str | None:
    """FAULTS B17."""
    pack, source = f.rules.policy.pack, f.rules.policy.source
    if f.soh is None or f.soh >= pack.soh_min_pct:
        return None
    return f"SOH {f.soh:.0f} %, below {pack.soh_min_pct:g} % ({source.at('pack.soh_min_pct')})"


def other_master(f: Facts) -> str | None:
    """FAULTS B27: only said; what it does to the BMU shows elsewhere."""
    seen_s = f.battery.other_master_t_s
    return f.battery.other_master if seen_s is not None and f.now_s - seen_s < NEWS_S else None


def heartbeat_set(f: Facts) -> str | None:
    """FAULTS B28."""
    seen_s = f.battery.heartbeat_set_t_s
    return f.battery.heartbeat_set if seen_s is not None and f.now_s - seen_s < NEWS_S else None
