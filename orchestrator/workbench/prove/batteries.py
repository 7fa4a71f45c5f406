"""What a battery can show, cut by a policy's thresholds."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from orchestrator.config.amperes import ranges, row_a, tables
from orchestrator.config.station import Limits
from orchestrator.core.cells import chemistry
from orchestrator.core.memory import Memory
from orchestrator.core.rules import Rules
from orchestrator.model import BatteryLink, BatteryReading, BatteryStatus, Measurement
from orchestrator.model.cause import said

#: A value that was asked for right before the step, and one that is far too old.
FRESH_S, OLD_S = 0.05, 30.0
HEARTBEAT_S = 0.5
#: How far beside a bound "just below" and "just above" lie: the resolution of what a BMU sends.
NEAR = {"voltage_v": 0.01, "temperature_c": 0.1, "soc_pct": 1.0, "soh_pct": 1.0}

#: Two volts of a cell that are no farther apart are of one state of charge.
NEAR_CELL_V = 0.02

#: What two instruments of this kind may differ by, measuring the same: cable, resolution, offset.
WITHIN_V, WITHIN_A = 0.5, 0.5

Link = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Shown:
    """One class: the true values, and how what the BMU says differs from them."""

    values: Mapping[str, float]
    takes: float = 0.9  #: of the charger's limit, what flows
    differs_v: float = 0.0  #: how much more the charger reads than the BMU
    differs_a: float = 0.0  #: how much more the BMU reads than the charger
    connected: bool = True
    old: frozenset[str] = frozenset()  #: values that are too old
    link: Callable[[float, Memory], Link] = field(default=lambda _now_s, _memory: {})
    at_work: bool = False  #: only rows that allow a step tell it from others: it is another one while there are steps

    @property
    def volts(self) -> float:
        """At the terminals."""
        return self.values["voltage_v"]

    def at(self, now_s: float, memory: Memory, charger_a: float) -> tuple[BatteryReading, BatteryLink]:
        """As it is read at this moment."""
        values = {**self.values, "current_a": charger_a + self.differs_a}
        reading = BatteryReading(
            **{
                name: Measurement(value, now_s - (OLD_S if name in self.old else FRESH_S))
                for name, value in values.items()
            }
        )
        link: dict[str, Any] = {
            "online": True, "boots": memory.battery.boots, "heartbeat_s": HEARTBEAT_S, "heartbeat_t_s": now_s - FRESH_S,
            **self.link(now_s, memory),
        }  # fmt: skip
        return (reading if link.pop("speaks", True) else BatteryReading()), BatteryLink(**link)


def _fixed(**link: Any) -> Callable[[float, Memory], Link]:  # noqa: ANN401 - fields of BatteryLink
    return lambda _now_s, _memory: link


def _booted(now_s: float, memory: Memory) -> Link:
    return {"boots": memory.battery.boots + 1, "boot_t_s": now_s - 0.1, "heartbeat_s": None, "speaks": False}


def _heartbeat_lost(now_s: float, _memory: Memory) -> Link:
    return {"heartbeat_t_s": now_s - OLD_S}


FAST = frozenset({"voltage_v", "current_a", "status", "temperature_c"})
SLOW = frozenset({"soc_pct", "soh_pct"})


def fitting_v(rules: Rules, soc_pct: float) -> float:
    """What the policy's pack has at this state of charge."""
    pack = rules.policy.pack
    return round(chemistry(pack).ocv_v(soc_pct) * pack.cells_in_series, 2)


def fitting_pct(rules: Rules, pack_v: float) -> float:
    """A state of charge that the policy's pack may have at this voltage; an empty one has any that is low."""
    pack = rules.policy.pack
    kind = chemistry(pack)
    fits = (soc for soc in range(100) if abs(kind.ocv_v(soc) - pack_v / pack.cells_in_series) < NEAR_CELL_V)
    return float(next(fits, 99.0 if pack_v > fitting_v(rules, 90.0) else 1.0))


def healthy(rules: Rules) -> Shown:
    """In the middle of everything."""
    soc = min(rules.policy.start.soc_below_pct, rules.policy.recharge.soc_below_pct) / 2
    return Shown(
        {
            "voltage_v": fitting_v(rules, soc), "status": 0.0, "soc_pct": soc, "soh_pct": 100.0,
            "temperature_c": (rules.temperature_c.low + rules.temperature_c.high) / 2,
        }
    )  # fmt: skip


def batteries(rules: Rules) -> dict[str, Shown]:
    """Every class for this bay, by its name."""
    base = healthy(rules)
    classes = {"healthy": base}
    rows = _rows(rules)
    for field_name, bounds in _bounds(rules).items():
        for bound in sorted(bounds | rows[field_name]):
            for word, value in (
                ("just below", bound - NEAR[field_name]), ("at", bound), ("just above", bound + NEAR[field_name]),
            ):  # fmt: skip
                name = f"{field_name} {word} {bound:g}"
                values = {**base.values, **_with(rules, field_name, value)}
                classes[name] = replace(base, values=values, at_work=bound not in bounds)
    return classes | _events(base, rules)


def _with(rules: Rules, field_name: str, value: float) -> dict[str, float]:
    """This value, and what goes with it: volts and SOC of one pack hang together."""
    if field_name == "soc_pct":
        return {"soc_pct": value, "voltage_v": fitting_v(rules, value)}
    if field_name == "voltage_v":
        return {"voltage_v": value, "soc_pct": fitting_pct(rules, value)}
    return {field_name: value}


def _bounds(rules: Rules) -> dict[str, set[float]]:
    """The thresholds of policy and station, by field, but for those of the tables of steps."""
    policy = rules.policy
    volts = {policy.pack.voltage_v.low, rules.max_v}
    if policy.precharge is not None:
        volts |= {policy.precharge.below_v, policy.precharge.pulse.until_v}
    if rules.taper is not None:
        volts.add(rules.taper.above_v)
    bounds = {
        "voltage_v": volts,
        "temperature_c": {rules.temperature_c.low, rules.temperature_c.high, policy.faults.temperature_trip_c},
        "soc_pct": {policy.start.soc_below_pct, policy.recharge.soc_below_pct, policy.finish.target_soc_pct, 80.0},
        "soh_pct": {policy.pack.soh_min_pct},
    }
    for row in _pauses(rules):
        for name, (low, high) in row.items():
            bounds[name] |= {low, high}
    return bounds


Span = Mapping[str, tuple[float, float]]


def _spans(rules: Rules) -> Iterator[tuple[Span, float]]:
    """Every row of the policy: which values it is about, and what it allows, in amperes."""
    current, pack = rules.policy.current, rules.policy.pack
    for name, table in tables(current):
        for band in table.rows:
            yield {name: (band.from_, band.to)}, row_a(band, pack.current_a, pack.capacity_ah)
    for rule in current.where:
        spans = {name: (span.low, span.high) for name, span in ranges(rule).items()}
        yield spans, row_a(rule, pack.current_a, pack.capacity_ah)


def _pauses(rules: Rules) -> Iterator[Span]:
    """Rows that allow less than the lowest step: they keep a bay at rest."""
    return (span for span, allowed_a in _spans(rules) if allowed_a < rules.worst_a[0])


def _rows(rules: Rules) -> dict[str, set[float]]:
    """The bounds of all rows: what only they tell apart decides nothing at rest."""
    rows: dict[str, set[float]] = {name: set() for name in NEAR}
    for span, _ in _spans(rules):
        for name, (low, high) in span.items():
            rows[name] |= {low, high}
    return rows


def _beyond(limits: Limits) -> dict[str, dict[str, float]]:
    """What a station allows under no policy."""
    return {
        "beyond the station's voltage": {"voltage_v": limits.voltage_v + NEAR["voltage_v"]},
        "colder than the station allows": {"temperature_c": limits.temperature_c.low - NEAR["temperature_c"]},
        "hotter than the station allows": {"temperature_c": limits.temperature_c.high + NEAR["temperature_c"]},
    }


def _full(base: Shown, rules: Rules) -> Shown:
    """At the target, or full: its current has tapered off at the end voltage."""
    full = {**base.values, **_with(rules, "soc_pct", rules.policy.finish.target_soc_pct)}
    if rules.policy.finish.target_soc_pct < 100 or rules.taper is None:
        return replace(base, values=full)
    end_v = min(max(full["voltage_v"], rules.taper.above_v + WITHIN_V), rules.max_v - NEAR["voltage_v"])
    return replace(base, takes=0.01, values={**full, "voltage_v": end_v})


def _events(base: Shown, rules: Rules) -> dict[str, Shown]:
    """What no threshold cuts: a battery that leaves, falls silent, complains or lies."""
    pack, precharge = rules.policy.pack, rules.policy.precharge
    status = {**base.values, "status": float(1 << BatteryStatus.BMU_ERROR)}
    limit = {**base.values, "status": float(1 << BatteryStatus.LOW_TEMPERATURE)}
    deep: dict[str, Shown] = {}
    if precharge is not None and rules.manual:
        low_v = (pack.voltage_v.low + precharge.below_v) / 2
        deep["deeply discharged"] = replace(base, values={**base.values, "voltage_v": low_v, "soc_pct": 1.0})
    return deep | {
        "full": _full(base, rules),
        "takes nothing": replace(base, takes=0.0),
        "tapers": replace(base, takes=0.01, values={**base.values, **_with(rules, "voltage_v", rules.max_v - 0.1)}),
        "of another kind": replace(base, values={**base.values, "voltage_v": pack.voltage_v.low, "soc_pct": 50.0}),
        **{name: replace(base, values={**base.values, **value}) for name, value in _beyond(rules.bay.limits).items()},
        "absent": replace(base, connected=False, link=_fixed(online=False, speaks=False, problem=said("no answer"))),
        "silent": replace(base, link=_fixed(online=False, speaks=False, problem=said("no answer"))),
        "not trusted": replace(base, link=_fixed(online=False, problem=said("answered twice"))),
        "old fast values": replace(base, old=FAST),
        "old temperature": replace(base, old=frozenset({"temperature_c"})),
        "old slow values": replace(base, old=SLOW),
        "booted": replace(base, link=_booted),
        "no heartbeat": replace(base, link=_heartbeat_lost),
        "refuses a read": replace(base, link=_fixed(abort=said("0x6004 refused"), abort_code=0x06020000)),
        "cannot answer now": replace(base, link=_fixed(abort=said("0x6004 not now"), abort_code=0x08000022)),
        "implausible SOC": replace(base, link=_fixed(implausible={"soc_pct": said("SOC 140 %")})),
        "implausible temperature": replace(base, link=_fixed(implausible={"temperature_c": said("−40.0 °C")})),
        "status bit that trips": replace(base, values=status),
        "status bit that limits": replace(base, values=limit),
        "emergency": replace(base, link=_fixed(emergency=said("EMCY 0x5000"))),
        "measured differently": replace(base, takes=1.0, differs_v=WITHIN_V, differs_a=WITHIN_A),
        "another voltage than the charger's": replace(base, differs_v=5.0),
        "another current than the charger's": replace(base, differs_a=5.0),
        "discharges": replace(base, differs_a=-20.0),
        "read by another master": replace(
            base, link=lambda now_s, _: {"other_master": said("a"), "other_master_t_s": now_s}
        ),
    }
