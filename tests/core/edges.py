"""A charge in which all is well except what a test names, and any rule of the core applied to it alone."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any

from orchestrator.config.policy import Policy
from orchestrator.core.facts import Facts
from orchestrator.core.memory import FaultMemory
from orchestrator.core.rules import Rules
from orchestrator.core.states import ENERGISED
from orchestrator.core.witnesses.followed import Witnessed
from orchestrator.model import (
    BatteryLink,
    BatteryReading,
    Cause,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Connection,
    ControlMode,
    Measurement,
    Operation,
    Precharge,
    Session,
    Snapshot,
    State,
)
from tests.core.bays import POLICY
from tests.core.said import cause
from tests.core.world import bay, remembering
from tests.ids import short, shown

NOW_S = 100_000.0
AT = POLICY.source.at
READING = ChargerReading(
    NOW_S, 48.0, 10.0, ControlMode.MANUAL, Operation.RUNNING, 4, ChargeMode.CHARGE, Precharge.OFF, Connection.NORMAL
)
BMU = BatteryReading(
    voltage_v=Measurement(48.0, NOW_S), current_a=Measurement(10.0, NOW_S), status=Measurement(0.0, NOW_S),
    temperature_c=Measurement(20.0, NOW_S), soc_pct=Measurement(50.0, NOW_S), soh_pct=Measurement(100.0, NOW_S),
)  # fmt: skip
PULSE, CONTINUOUS, CHARGING = State.PRECHARGE_PULSE, State.PRECHARGE_CONTINUOUS, State.CHARGING
NO_PRECHARGE = replace(POLICY, precharge=None)


def ago(seconds: float) -> float:
    return NOW_S - seconds


#: Of a charger: the newest reply is too old to count; it is in standby, at the end of a charge.
UNHEARD: dict[str, Any] = {"t_s": ago(9)}
STANDS_BY: dict[str, Any] = {"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL, "current_a": 0.0}

#: What a rule returns, for a test's name, if that is no sentence.
ANSWERS: dict[object, str] = {None: "silent", True: "yes", False: "no"}


@dataclass(frozen=True)
class Edge:
    """A charge in which all is well except what is named here; `says` is what the rule returns, None for nothing."""

    rule: Callable[[Facts], object]
    says: object
    memory: dict[str, Any] = field(default_factory=dict)
    state: State = CHARGING
    state_s: float = 60.0
    bmu: dict[str, float | None] = field(default_factory=dict)
    charger: dict[str, Any] = field(default_factory=dict)
    bmu_link: dict[str, Any] = field(default_factory=dict)
    charger_link: dict[str, Any] = field(default_factory=dict)
    snapshot: dict[str, Any] = field(default_factory=dict)
    policy: Policy = POLICY
    control: ControlMode = ControlMode.MANUAL
    tpdo_s: float | None = None

    @property
    def name(self) -> str:
        """The rule, what is special about the charge, and what the rule returns."""
        usual = Edge(self.rule, self.says)
        special: dict[str, object] = {}
        for name in (each.name for each in fields(self)[2:]):
            if (one := getattr(self, name)) != getattr(usual, name):
                special |= one if isinstance(one, dict) else {name: one}
        says = ANSWERS.get(self.says) or short(shown(self.says), 40)
        return f"{self.rule.__name__}-{short(shown(special), 90)}-{says}"

    @property
    def facts(self) -> Facts:
        values = self.bmu if self.state in ENERGISED else {"current_a": 0.0, **self.bmu}
        measured = {name: None if x is None else Measurement(x, NOW_S) for name, x in values.items()}
        proof = witnessed() if "stop_sent_s" in self.charger_link else {}
        begun = {"state": self.state, "since_s": ago(self.state_s), "ran": True, "runs_s": ago(50)}
        memory = remembering(**{**begun, **proof, **self.memory})
        snapshot = Snapshot(
            charger=replace(READING, **self.charger),
            charger_link=replace(ChargerLink(online=True), **self.charger_link),
            battery=replace(BMU, **measured),
            battery_link=replace(BatteryLink(online=True), **self.bmu_link),
        )
        the_bay = bay(self.policy, self.control)
        the_bay = replace(the_bay, battery=replace(the_bay.battery, tpdo_s=self.tpdo_s))
        return Facts.of(NOW_S, replace(snapshot, **self.snapshot), memory, Rules.of(the_bay))


def by_policy(id_: str, key: str, /, **params: Any) -> Cause:
    """A cause with a key of the usual policy and the line where it stands."""
    return Cause(id_, tuple(params.items()), key, AT(key))


def session(hours: float = 1.0, ah: float = 1.0, soc_start_pct: float | None = 0.0) -> dict[str, Any]:
    return {"session": Session(0.0, energised_s=hours * 3600, charged_ah=ah, soc_start_pct=soc_start_pct)}


def marked(minutes: float, volts: float) -> dict[str, Any]:
    """The pack had this voltage this many minutes of precharge ago."""
    return {"session": Session(ago(9999), rise_s=minutes * 60, rise_v=volts)}


def witnessed(**known: Any) -> dict[str, Any]:
    """The state of both witnesses: a stop in this state and two replies to it, unless given otherwise."""
    return {"witnessed": Witnessed(**{"stop_s": ago(1), "proof": (ago(0.5), NOW_S), **known})}


def raised(*names: str) -> dict[str, Any]:
    return {"faults": {name: FaultMemory(raised_s=1.0, cause=cause(f"text of {name}")) for name in names}}
