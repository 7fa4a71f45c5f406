"""The classes of battery inputs, cut at a policy's thresholds."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from orchestrator.config.amperes import ranges, row_a, tables
from orchestrator.config.station import Limits
from orchestrator.core.cells import chemistry
from orchestrator.core.memory import Memory
from orchestrator.core.parts import changed, made
from orchestrator.core.rules import Rules
from orchestrator.model import BatteryLink, BatteryReading, BatteryStatus, Measurement
from orchestrator.model.cause import said

#: The age of a value requested right before the decision, and of one that is far too old.
FRESH_S, OLD_S = 0.05, 30.0
HEARTBEAT_S = 0.5
#: The distance from a bound to "just below" and "just above": the resolution of a BMU's values.
NEAR = {"voltage_v": 0.01, "temperature_c": 0.1, "soc_pct": 1.0, "soh_pct": 1.0}

#: Cell voltages this close belong to the same state of charge.
NEAR_CELL_V = 0.02

#: How much two honest instruments may differ on the same quantity: cable, resolution, offset.
WITHIN_V, WITHIN_A = 0.5, 0.5

Link = Mapping[str, Any]

#: What inputs are made from, because that is much faster than by their constructors.
SILENT, UNKNOWN = BatteryReading(), BatteryLink()


@dataclass(frozen=True, slots=True)
class Shown:
    """One class: the true values, and how the BMU's readings differ from them."""

    values: Mapping[str, float]
    takes: float = 0.9  #: the current, as a share of the charger's limit
    differs_v: float = 0.0  #: how much more the charger reads than the BMU
    differs_a: float = 0.0  #: how much more the BMU reads than the charger
    connected: bool = True
    old: frozenset[str] = frozenset()  #: values that are too old
    link: Callable[[float, Memory], Link] = field(default=lambda _now_s, _memory: {})
    at_work: bool = False  #: only rows that allow a step distinguish it, so it is a class only where steps matter

    @property
    def volts(self) -> float:
        """The terminal voltage."""
        return self.values["voltage_v"]

    def at(self, now_s: float, memory: Memory, charger_a: float) -> tuple[BatteryReading, BatteryLink]:
        """The reading and the link at this moment."""
        values = {**self.values, "current_a": charger_a + self.differs_a}
        reading = changed(
            SILENT,
            **{
                name: made(Measurement, value, now_s - (OLD_S if name in self.old else FRESH_S))
                for name, value in values.items()
            },
        )
        link: dict[str, Any] = {
            "online": True, "boots": memory.battery.boots, "heartbeat_s": HEARTBEAT_S, "heartbeat_t_s": now_s - FRESH_S,
            **self.link(now_s, memory),
        }  # fmt: skip
        return (reading if link.pop("speaks", True) else SILENT), changed(UNKNOWN, **link)


def _fixed(**link: Any) -> Callable[[float, Memory], Link]:  # noqa: ANN401 - fields of BatteryLink
    return lambda _now_s, _memory: link


def _booted(now_s: float, memory: Memory) -> Link:
    return {"boots": memory.battery.boots + 1, "boot_t_s": now_s - 0.1, "heartbeat_s": None, "speaks": False}


def _heartbeat_lost(now_s: float, _memory: Memory) -> Link:
    return {"heartbeat_t_s": now_s - OLD_S}


FAST = frozenset({"voltage_v", "current_a", "status", "temperature_c"})
SLOW = frozenset({"soc_pct", "soh_pct"})


def fitting_v(rules: Rules, soc_pct: float) -> float:
    """The voltage of the policy's pack at this state of charge."""
    pack = rules.policy.pack
    return round(chemistry(pack).ocv_v(soc_pct) * pack.cells_in_series, 2)


def fitting_pct(rules: Rules, pack_v: float) -> float:
    """A state of charge that fits this voltage for the policy's pack; below the curve, a low one."""
    pack = rules.policy.pack
    kind = chemistry(pack)
    fits = (soc for soc in range(100) if abs(kind.ocv_v(soc) - pack_v / pack.cells_in_series) < NEAR_CELL_V)
    return float(next(fits, 99.0 if pack_v > fitting_v(rules, 90.0) else 1.0))


def healthy(rules: Rules) -> Shown:
    """A battery in the middle of all ranges."""
    soc = min(rules.policy.start.soc_below_pct, rules.policy.recharge.soc_below_pct) / 2
    return Shown(
        {
            "voltage_v": fitting_v(rules, soc), "status": 0.0, "soc_pct": soc, "soh_pct": 100.0,
            "temperature_c": (rules.temperature_c.low + rules.temperature_c.high) / 2,
        }
    )  # fmt: skip


def batteries(rules: Rules) -> dict[str, Shown]:
    """Every class for this bay, by name."""
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
    """This value and the values that depend on it: a pack's voltage and SOC go together."""
    if field_name == "soc_pct":
        return {"soc_pct": value, "voltage_v": fitting_v(rules, value)}
    if field_name == "voltage_v":
        return {"voltage_v": value, "soc_pct": fitting_pct(rules, value)}
    return {field_name: value}


def _bounds(rules: Rules) -> dict[str, set[float]]:
    """The thresholds of policy and station, by field, except those of rows that allow a step."""
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
    """Every row of the policy: its ranges, and the amperes that it allows."""
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
    """The bounds of all rows: a difference that only they see decides nothing at rest."""
    rows: dict[str, set[float]] = {name: set() for name in NEAR}
    for span, _ in _spans(rules):
        for name, (low, high) in span.items():
            rows[name] |= {low, high}
    return rows


def _beyond(limits: Limits) -> dict[str, dict[str, float]]:
    """Values that a station allows under no policy."""
    return {
        "beyond the station's voltage": {"voltage_v": limits.voltage_v + NEAR["voltage_v"]},
        "colder than the station allows": {"temperature_c": limits.temperature_c.low - NEAR["temperature_c"]},
        "hotter than the station allows": {"temperature_c": limits.temperature_c.high + NEAR["temperature_c"]},
    }


def _full(base: Shown, rules: Rules) -> Shown:
    """A battery at the target, or full: its current has tapered off at the end voltage."""
    full = {**base.values, **_with(rules, "soc_pct", rules.policy.finish.target_soc_pct)}
    if rules.policy.finish.target_soc_pct < 100 or rules.taper is None:
        return replace(base, values=full)
    end_v = min(max(full["voltage_v"], rules.taper.above_v + WITHIN_V), rules.max_v - NEAR["voltage_v"])
    return replace(base, takes=0.01, values={**full, "voltage_v": end_v})


def _events(base: Shown, rules: Rules) -> dict[str, Shown]:
    """Classes independent of thresholds: a battery that leaves, falls silent, complains or lies."""
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
