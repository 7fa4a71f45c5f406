"""Faults of the battery and its BMU."""

from orchestrator.core.facts import Facts
from orchestrator.core.witnesses.pack import another_pack
from orchestrator.model import BatteryStatus, Cause
from orchestrator.model.cause import together

#: Hysteresis of the pauses for heat and for cold.
HEAT_HYSTERESIS_K = 5.0
COLD_HYSTERESIS_K = 3.0
#: No pack warms or cools this fast within a second; a sensor that reports it is broken.
JUMP_K = 5.0
#: The rate of warming is measured over this long.
WARMING_S = 180.0
#: Heartbeats are lost after this many periods: of a node that answers nothing else, and of one that does.
SILENT_PERIODS, ANSWERING_PERIODS = 2.5, 4.5
#: SDO abort codes (upper half) that mean: the object does not exist, or not in this form. The others may pass.
REFUSALS = frozenset({0x0601, 0x0602, 0x0604, 0x0606, 0x0607, 0x0609})
#: What another node did on the bus is news for this long.
NEWS_S = 10.0
#: NMT states as reported in a heartbeat (CiA 301).
OPERATIONAL = 0x05
NMT_NAMES = {0x00: "boot_up", 0x04: "stopped", 0x7F: "pre_operational"}
#: Bits that end a charge, and bits that limit it. A deeply discharged pack reports low voltage.
STATUS_TRIPS = (
    BatteryStatus.OVER_VOLTAGE,
    BatteryStatus.CHARGE_OVER_CURRENT,
    BatteryStatus.HIGH_TEMPERATURE,
    BatteryStatus.BMU_ERROR,
)
STATUS_LIMITS = (BatteryStatus.LOW_TEMPERATURE, BatteryStatus.DISCHARGE_OVER_CURRENT)


def bmu_silent(f: Facts) -> Cause | None:
    """FAULTS B1, B5, B19, B21: no values, or a line or node whose values cannot be trusted."""
    silent = f.silent or (not f.present and f.quiet)  # not just one value: nothing arrives any more
    if (f.battery.online and not silent) or f.just_booted or f.stalled:
        return None
    if f.battery.problem:
        return f.battery.problem
    return Cause.of("bmu_silent", node_id=f.rules.bay.battery.node_id)


def stale_reading(f: Facts) -> Cause | None:
    """FAULTS B2: it answers, but not with everything that a charge needs."""
    if f.silent or f.present or f.stalled or (f.quiet and not f.just_booted):  # else it is silent
        return None
    return Cause.of("stale_reading", missing=f.missing)


def sdo_refused(f: Facts) -> Cause | None:
    """FAULTS B3: the object does not exist, or not in this form."""
    link = f.battery
    return link.abort if link.abort_code >> 16 in REFUSALS else None


def sdo_aborted(f: Facts) -> Cause | None:
    """FAULTS B4: the BMU cannot answer now."""
    link = f.battery
    return link.abort if link.abort_code >> 16 not in REFUSALS else None


def heartbeat_lost(f: Facts) -> Cause | None:
    """FAULTS B6. A node that answers is alive, and a poor bus loses two heartbeats in a row several times a day."""
    link, volts = f.battery, f.snapshot.battery.voltage_v
    if link.heartbeat_s is None or link.heartbeat_t_s is None or f.stalled:
        return None
    age_s = f.now_s - link.heartbeat_t_s
    answered_s = volts.t_s if volts is not None else link.heartbeat_t_s
    silent = f.now_s - answered_s > SILENT_PERIODS * link.heartbeat_s
    allowed = SILENT_PERIODS if silent else ANSWERING_PERIODS
    return Cause.of("heartbeat_lost", age_s=age_s) if age_s > allowed * link.heartbeat_s else None


def not_operational(f: Facts) -> Cause | None:
    """FAULTS B8: only heartbeats report the state, and only TPDOs need it; SDO reads continue meanwhile."""
    link = f.battery
    if f.rules.bay.battery.tpdo_s is None or link.heartbeat_s is None or link.nmt_state in (None, OPERATIONAL):
        return None
    return Cause.of("not_operational", nmt_state=NMT_NAMES.get(link.nmt_state, f"0x{link.nmt_state:02X}"))


def bmu_rebooted(f: Facts) -> Cause | None:
    """FAULTS B7."""
    return Cause("bmu_rebooted") if f.battery.boots != f.memory.battery.boots else None


def status_trip(f: Facts) -> Cause | None:
    """FAULTS B9."""
    return _status("status_trip", f, STATUS_TRIPS)


def status_limit(f: Facts) -> Cause | None:
    """FAULTS B9, the mild bits."""
    return _status("status_limit", f, STATUS_LIMITS)


def _status(id_: str, f: Facts, bits: tuple[BatteryStatus, ...]) -> Cause | None:
    if not f.status:
        return None
    word = int(f.status)
    names = tuple(bit.name.lower() for bit in bits if word >> bit & 1)
    return Cause.of(id_, bits=names, status=word) if names else None


def emergency(f: Facts) -> Cause | None:
    """FAULTS B9."""
    return f.battery.emergency


def over_temperature(f: Facts) -> Cause | None:
    """FAULTS B10."""
    high = f.rules.temperature_c.high
    again = high - HEAT_HYSTERESIS_K
    if f.temperature_c is None or f.temperature_c < (again if "over_temperature" in f.raised else high):
        return None
    key, place = f.rules.hottest_at
    return Cause.of("over_temperature", key=key, place=place, pack_c=f.temperature_c, limit_c=high, again_c=again)


def hot_trip(f: Facts) -> Cause | None:
    """FAULTS B10, when cooling down is not enough."""
    policy = f.rules.policy
    limit = policy.faults.temperature_trip_c
    if f.temperature_c is None or f.temperature_c < limit:
        return None
    return f.rules.by_policy("hot_trip", "faults.temperature_trip_c", pack_c=f.temperature_c, limit_c=limit)


def under_temperature(f: Facts) -> Cause | None:
    """FAULTS B11."""
    low = f.rules.temperature_c.low
    again = low + COLD_HYSTERESIS_K
    if f.temperature_c is None or f.temperature_c >= (again if "under_temperature" in f.raised else low):
        return None
    key, place = f.rules.coldest_at
    return Cause.of("under_temperature", key=key, place=place, pack_c=f.temperature_c, limit_c=low, again_c=again)


def runaway(f: Facts) -> Cause | None:
    """FAULTS B12."""
    if f.temperature_c is None or not f.memory.battery.warmth:
        return None
    t_s, then_c = f.memory.battery.warmth[0]
    lasted_s = f.now_s - t_s
    if lasted_s < WARMING_S:
        return None
    rate = (f.temperature_c - then_c) / lasted_s * 60
    limit = f.rules.policy.faults.temperature_rise_k_per_min
    if rate <= limit:
        return None
    key = "faults.temperature_rise_k_per_min"
    return f.rules.by_policy("runaway", key, rate_k_per_min=rate, limit_k_per_min=limit)


def temperature_invalid(f: Facts) -> Cause | None:
    """FAULTS B13."""
    if f.just_booted:
        return None
    wrong = f.battery.implausible.get("temperature_c")
    if wrong:
        return wrong
    if f.memory.battery.sample is None or f.memory.battery.sample_before is None:
        return None
    (before_s, before_c), (newest_s, newest_c) = f.memory.battery.sample_before, f.memory.battery.sample
    passed_s = newest_s - before_s
    if abs(newest_c - before_c) <= JUMP_K * max(passed_s, 1.0):
        return None
    return Cause.of("temperature_jump", before_c=before_c, pack_c=newest_c, passed_s=passed_s)


def implausible(f: Facts) -> Cause | None:
    """FAULTS B14, B17: an impossible value."""
    if not f.battery.implausible or f.just_booted:
        return None
    wrong = [cause for name, cause in f.battery.implausible.items() if name != "temperature_c"]
    return together(wrong) if wrong else None


def under_voltage(f: Facts) -> Cause | None:
    """FAULTS B14: too low to be woken."""
    pack = f.rules.policy.pack
    if f.pack_v is None or f.pack_v >= pack.voltage_v.low or another_pack(f) is not None:
        return None
    return f.rules.by_policy("under_voltage", "pack.voltage_v", pack_v=f.pack_v, limit_v=pack.voltage_v.low)


def needs_precharge(f: Facts) -> Cause | None:
    """A pack that the policy has no way to wake."""
    policy = f.rules.policy
    if policy.precharge is not None or f.status is None or not int(f.status) >> BatteryStatus.LOW_VOLTAGE & 1:
        return None
    return Cause("needs_precharge")


def soh_low(f: Facts) -> Cause | None:
    """FAULTS B17."""
    pack = f.rules.policy.pack
    if f.soh is None or f.soh >= pack.soh_min_pct:
        return None
    return f.rules.by_policy("soh_low", "pack.soh_min_pct", soh_pct=f.soh, limit_pct=pack.soh_min_pct)


def other_master(f: Facts) -> Cause | None:
    """FAULTS B27: only reported; its effect on the BMU shows elsewhere."""
    seen_s = f.battery.other_master_t_s
    if seen_s is None or f.now_s - seen_s >= NEWS_S:
        return None
    return f.battery.other_master


def heartbeat_set(f: Facts) -> Cause | None:
    """FAULTS B28."""
    seen_s = f.battery.heartbeat_set_t_s
    if seen_s is None or f.now_s - seen_s >= NEWS_S:
        return None
    return f.battery.heartbeat_set
