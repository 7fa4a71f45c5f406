"""The rules for one bay: its station entry and its policy, with the stricter of both worked out once."""

from dataclasses import dataclass
from typing import Any

from orchestrator.config.amperes import (
    DIGITS,
    TableRule,
    TaperRule,
    hysteresis,
    max_ah,
    max_hours,
    ranges,
    table_rules,
    taper_of,
    where_a,
)
from orchestrator.config.policy import Band, Policy, Where
from orchestrator.config.station import BayConfig
from orchestrator.keys import Range
from orchestrator.model import Cause, ControlMode

#: A charger's current measurement may be off by this, whatever the step.
OVER_CURRENT_OFFSET_A = 0.3

Spans = tuple[tuple[str, Range, float], ...]  #: quantity, the range in which a rule holds, and its hysteresis


@dataclass(frozen=True, slots=True)
class Bound:
    """One thing that limits the current."""

    allowed_a: float
    key: str  #: of policy or station; "fault ID" for a fault
    row: Band | Where | None = None


@dataclass(frozen=True, slots=True)
class Rules:
    """Fixed for as long as a bay runs on one policy; made by `Rules.of(bay)`."""

    bay: BayConfig
    policy: Policy
    manual: bool  #: the charger takes setpoint values, not only stop and resume
    max_v: float  #: no current above this, at the charger or at the pack
    temperature_c: Range  #: no current outside
    steps_a: tuple[float, ...]  #: the nominal current of each current step
    worst_a: tuple[float, ...]  #: the most that may flow on each of them
    top_step: int  #: the highest step within the station's current limit
    tables: tuple[TableRule, ...]  #: what the policy allows by one quantity …
    where_a: tuple[float, ...]  #: … and by several, one value per rule of its `where`
    pack_bound: Bound  #: the limit that always applies …
    table_bounds: tuple[tuple[Bound, ...], ...]  #: … the one in each row of each table …
    where_bounds: tuple[Bound, ...]  #: … and in each rule of `where` …
    where_spans: tuple[Spans, ...]  #: … with the quantities that it is about
    taper: TaperRule | None  #: when the current counts as tapered off; None: never
    max_hours: float  #: a charge that takes longer is a fault
    max_ah: float  #: … and so is one that takes more

    @classmethod
    def of(cls, bay: BayConfig) -> "Rules":
        """The stricter of station and policy for each limit that both have."""
        policy, limits, charger = bay.policy, bay.limits, bay.charger
        worst_a = tuple(round(amps * (1 + charger.tolerance_pct / 100), DIGITS) for amps in charger.steps_a)
        allowed = [index for index, amps in enumerate(worst_a) if amps <= limits.current_a]
        tables, allowed_a = table_rules(policy), where_a(policy)
        return cls(
            bay=bay,
            policy=policy,
            manual=bay.charger.control is ControlMode.MANUAL,
            max_v=min(policy.pack.voltage_v.high, limits.voltage_v),
            temperature_c=Range(
                max(policy.pack.temperature_c.low, limits.temperature_c.low),
                min(policy.pack.temperature_c.high, limits.temperature_c.high),
            ),
            steps_a=charger.steps_a,
            worst_a=worst_a,
            top_step=max(allowed, default=0),
            tables=tables,
            where_a=allowed_a,
            pack_bound=Bound(policy.pack.current_a, "pack.current_a"),
            table_bounds=tuple(
                tuple(
                    Bound(amps, f"current.{table.name}.rows[{number}]", row)
                    for number, (amps, row) in enumerate(zip(table.amps, table.rows, strict=True))
                )
                for table in tables
            ),
            where_bounds=tuple(
                Bound(amps, f"current.where[{number}]", rule)
                for number, (amps, rule) in enumerate(zip(allowed_a, policy.current.where, strict=True))
            ),
            where_spans=tuple(
                tuple((name, span, hysteresis(policy.current, name)) for name, span in ranges(rule).items())
                for rule in policy.current.where
            ),
            taper=taper_of(policy),
            max_hours=max_hours(policy, worst_a),
            max_ah=max_ah(policy.pack, policy.finish),
        )

    def by_policy(self, id_: str, key: str, /, **params: Any) -> Cause:  # noqa: ANN401 - as those of a cause
        """The cause with this key of the policy, and the line where it stands."""
        return Cause(id_, tuple(params.items()), key, self.policy.source.at(key))

    def measured_most_a(self, limit_a: float) -> float:
        """The highest current that may be measured at a charger limited to `limit_a`."""
        return limit_a * self.policy.faults.over_current_pct / 100 + OVER_CURRENT_OFFSET_A

    @property
    def hottest_at(self) -> tuple[str, str]:
        """Key and place of the upper temperature limit: the policy's, or the station's if that is lower."""
        return self._at(policy_is_stricter=self.policy.pack.temperature_c.high <= self.bay.limits.temperature_c.high)

    @property
    def coldest_at(self) -> tuple[str, str]:
        """Key and place of the lower temperature limit: the policy's, or the station's if that is higher."""
        return self._at(policy_is_stricter=self.policy.pack.temperature_c.low >= self.bay.limits.temperature_c.low)

    def _at(self, *, policy_is_stricter: bool) -> tuple[str, str]:
        if policy_is_stricter:
            return "pack.temperature_c", self.policy.source.at("pack.temperature_c")
        return "limits.temperature_c", self.bay.source.at("limits.temperature_c")
