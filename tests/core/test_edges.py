"""Every rule at its edge: the last value that is no fault, the first one that is, and the whole sentence.

The scenes of `test_faults.py` show what a fault leads to; here the rules are asked alone, with facts made by hand.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from orchestrator.config.policy import Policy
from orchestrator.core import latches
from orchestrator.core.checks import battery, charge, obedience, ourselves, pair, reports, state_of_charge
from orchestrator.core.course import Course, course
from orchestrator.core.facts import Facts
from orchestrator.core.finish import finished, tapers
from orchestrator.core.machine import Trigger
from orchestrator.core.memory import FaultMemory, Memory, Still
from orchestrator.core.rules import Rules
from orchestrator.core.track import Warmth, follow, follow_state, thinned
from orchestrator.model import (
    Action,
    BatteryLink,
    BatteryReading,
    ChargeMode,
    ChargerLink,
    ChargerReading,
    Command,
    Connection,
    ControlMode,
    ErrorBit,
    Measurement,
    Operation,
    Precharge,
    Session,
    Snapshot,
    State,
    Step,
)
from tests.core.bays import POLICY
from tests.core.world import bay

NOW_S = 100_000.0
AT = POLICY.source.at
READING = ChargerReading(
    NOW_S, 48.0, 10.0, ControlMode.MANUAL, Operation.RUNNING, 4, ChargeMode.CHARGE, Precharge.OFF, Connection.NORMAL
)
BMU = BatteryReading(
    voltage_v=Measurement(48.0, NOW_S), current_a=Measurement(10.0, NOW_S), status=Measurement(0.0, NOW_S),
    temperature_c=Measurement(20.0, NOW_S), soc_pct=Measurement(50.0, NOW_S), soh_pct=Measurement(100.0, NOW_S),
)  # fmt: skip
RUN, LIMIT_3 = Command(Action.RUN), Command(Action.SET_LIMIT, 3)
PULSE, CONTINUOUS, CHARGING = State.PRECHARGE_PULSE, State.PRECHARGE_CONTINUOUS, State.CHARGING
NO_PRECHARGE = replace(POLICY, precharge=None)
assert POLICY.precharge is not None


def ago(seconds: float) -> float:
    return NOW_S - seconds


@dataclass(frozen=True)
class Edge:
    """A charge in which all is well but for what is named here; what the rule says of it, None for nothing."""

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
    def facts(self) -> Facts:
        measured = {name: None if x is None else Measurement(x, NOW_S) for name, x in self.bmu.items()}
        memory = Memory(**{"state": self.state, "since_s": ago(self.state_s), "ran": True, "runs_s": ago(50),
                           **self.memory})  # fmt: skip
        snapshot = Snapshot(
            charger=replace(READING, **self.charger),
            charger_link=replace(ChargerLink(online=True), **self.charger_link),
            battery=replace(BMU, **measured),
            battery_link=replace(BatteryLink(online=True), **self.bmu_link),
        )
        the_bay = bay(self.policy, self.control)
        the_bay = replace(the_bay, battery=replace(the_bay.battery, tpdo_s=self.tpdo_s))
        return Facts(NOW_S, replace(snapshot, **self.snapshot), memory, Rules.of(the_bay))


def session(hours: float = 1.0, ah: float = 1.0, soc_start_pct: float | None = 0.0) -> dict[str, Any]:
    return {"session": Session(0.0, energised_s=hours * 3600, charged_ah=ah, soc_start_pct=soc_start_pct)}


def marked(minutes: float, volts: float) -> dict[str, Any]:
    """The pack had this voltage so many minutes ago."""
    return {"mark_s": ago(minutes * 60), "mark_v": volts}


def heart(age_s: float, nmt_state: int | None = 5) -> dict[str, Any]:
    return {"heartbeat_s": 0.5, "heartbeat_t_s": ago(age_s), "nmt_state": nmt_state}


def order(command: Command, seconds: float) -> dict[str, Any]:
    return {"order": command, "order_s": ago(seconds)}


def still(seconds: float, pack_v: float, pack_a: float) -> dict[str, Any]:
    return {"still": Still(ago(seconds), 48.0, 10.0, pack_v, pack_a)}


def raised(*names: str) -> dict[str, Any]:
    return {"faults": {name: FaultMemory(raised_s=1.0, text=f"text of {name}") for name in names}}


CHARGE = (
    Edge(charge.precharge_no_rise, None, marked(5, 47.75), PULSE, policy=replace(
        POLICY, precharge=replace(POLICY.precharge, rise=replace(POLICY.precharge.rise, volts=0.25)))),
    Edge(charge.precharge_no_rise, None, marked(4.99, 48.0), PULSE),
    Edge(charge.precharge_no_rise, f"the pack rose by 0.25 V in 5.0 min, 0.3 V were expected ({AT('precharge.rise')})",
         marked(5, 47.75), PULSE),
    Edge(charge.precharge_no_rise, f"the pack rose by 0.00 V in 6.0 min, 0.3 V were expected ({AT('precharge.rise')})",
         marked(6, 48.0), CONTINUOUS),
    Edge(charge.precharge_no_rise, None, marked(6, 48.0)),
    Edge(charge.precharge_no_rise, None, marked(6, 48.0), PULSE, policy=NO_PRECHARGE),
    Edge(charge.precharge_no_rise, None, marked(6, 48.0), PULSE, bmu={"voltage_v": None}),
    Edge(charge.precharge_too_long, None, state=CONTINUOUS, state_s=1200),
    Edge(charge.precharge_too_long, None, state=PULSE, state_s=1206),
    Edge(charge.precharge_too_long, None, state=CONTINUOUS, state_s=1206, policy=NO_PRECHARGE),
    Edge(charge.precharge_too_long, "continuous precharge has taken 20.1 min and the pack is below 39 V "
         f"({AT('precharge.continuous.max_min')})", state=CONTINUOUS, state_s=1206),
    Edge(charge.time_limit, None),
    Edge(charge.time_limit, None, session(hours=12)),
    Edge(charge.time_limit, f"charging has taken 12.00 h ({AT('finish.max_hours')})", session(hours=12.001)),
    Edge(charge.time_limit, f"charging has taken 99.00 h ({AT('finish.max_hours')})", session(hours=99)),
    Edge(charge.ah_limit, None),
    Edge(charge.ah_limit, None, session(ah=44)),
    *(Edge(charge.ah_limit, "44.01 Ah were charged since SOC 0 %: a whole charge may take 44 Ah "
           f"({AT('finish.max_ah')}), so from there 44.00 Ah", session(ah=44.01, soc_start_pct=soc_pct))
      for soc_pct in (0.0, None)),
    Edge(charge.ah_limit, None, session(ah=22, soc_start_pct=70)),
    Edge(charge.ah_limit, "22.01 Ah were charged since SOC 70 %: a whole charge may take 44 Ah "
         f"({AT('finish.max_ah')}), so from there 22.00 Ah", session(ah=22.01, soc_start_pct=70)),
)  # fmt: skip

FINISH = (
    Edge(finished, None, bmu={"soc_pct": 99.9}),
    Edge(finished, None, bmu={"soc_pct": None}),
    Edge(finished, f"SOC 100 % reached 100 % ({AT('finish.soc_pct')})", bmu={"soc_pct": 100.0}),
    Edge(finished, None, bmu={"soc_pct": 79.9}, charger={"charge_mode": ChargeMode.FULL}),
    Edge(finished, f"the charger reports full (mode 5) ({AT('finish.charger_full')})", bmu={"soc_pct": 80.0},
         charger={"charge_mode": ChargeMode.FULL}),
    Edge(finished, None, bmu={"soc_pct": 80.0}, charger={"charge_mode": ChargeMode.FULL},
         policy=replace(POLICY, finish=replace(POLICY.finish, charger_full=False))),
    Edge(finished, None, {"taper_s": ago(119.9)}),
    Edge(finished, f"10.00 A, tapered below 1 A for 120 s ({AT('finish.taper')})", {"taper_s": ago(120)}),
    Edge(finished, None, {"taper_s": ago(120)},
         policy=replace(POLICY, finish=replace(POLICY.finish, taper=None))),
    Edge(tapers, True, charger={"current_a": 0.99}, bmu={"voltage_v": 53.61}),
    Edge(tapers, False, charger={"current_a": 1.0}, bmu={"voltage_v": 53.61}),
    Edge(tapers, False, charger={"current_a": 0.99}, bmu={"voltage_v": 53.6}),
    Edge(tapers, False, charger={"current_a": 0.99}, bmu={"voltage_v": None}),
    Edge(tapers, False, charger={"current_a": 0.99, "t_s": ago(9)}, bmu={"voltage_v": 53.61}),
    Edge(tapers, False, {"runs_s": None}, charger={"current_a": 0.99}, bmu={"voltage_v": 53.61}),
    Edge(tapers, False, charger={"current_a": 0.99}, bmu={"voltage_v": 53.61},
         policy=replace(POLICY, finish=replace(POLICY.finish, taper=None))),
)  # fmt: skip

NOT_OPERATIONAL = "the BMU's NMT state is {}, not operational: it sends no TPDOs, and does not obey an NMT start"
BATTERY = (
    Edge(battery.heartbeat_lost, None, bmu_link={"heartbeat_s": None, "heartbeat_t_s": ago(9)}),
    Edge(battery.heartbeat_lost, None, bmu_link={"heartbeat_s": 0.5, "heartbeat_t_s": None}),
    Edge(battery.heartbeat_lost, None, bmu_link=heart(2.25)),
    Edge(battery.heartbeat_lost, "no heartbeat of the BMU for 2.5 s", bmu_link=heart(2.5)),
    Edge(battery.heartbeat_lost, None, bmu_link=heart(1.25), bmu={"voltage_v": None}),
    Edge(battery.heartbeat_lost, None, bmu_link=heart(2.0),
         snapshot={"battery": BatteryReading(voltage_v=Measurement(48.0, ago(1.25)))}),
    Edge(battery.heartbeat_lost, "no heartbeat of the BMU for 1.5 s", bmu_link=heart(1.5), bmu={"voltage_v": None}),
    Edge(battery.not_operational, NOT_OPERATIONAL.format("pre-operational"), bmu_link=heart(0, 0x7F), tpdo_s=0.1),
    Edge(battery.not_operational, NOT_OPERATIONAL.format("stopped"), bmu_link=heart(0, 4), tpdo_s=0.1),
    Edge(battery.not_operational, NOT_OPERATIONAL.format("0x42"), bmu_link=heart(0, 0x42), tpdo_s=0.1),
    Edge(battery.not_operational, None, bmu_link=heart(0), tpdo_s=0.1),
    Edge(battery.not_operational, None, bmu_link=heart(0, None), tpdo_s=0.1),
    Edge(battery.not_operational, None, bmu_link=heart(0, 4)),
    Edge(battery.not_operational, None, bmu_link={**heart(0, 4), "heartbeat_s": None}, tpdo_s=0.1),
    Edge(battery.runaway, None, {"warmth": ((ago(240), 16.0),)}),
    Edge(battery.runaway, None, {"warmth": ((ago(179), 0.0),)}),
    Edge(battery.runaway, "the pack warms by 1.10 K/min, more than 1 K/min", {"warmth": ((ago(180), 16.7),)}),
    Edge(battery.runaway, None, {"warmth": ((ago(180), 16.7),)}, bmu={"temperature_c": None}),
    Edge(battery.runaway, None),
    Edge(battery.temperature_invalid, None, {"sample_before": (1.0, 20.0), "sample": (1.5, 25.0)}),
    Edge(battery.temperature_invalid, "the pack's temperature went from 20.0 to 25.1 °C in 0.50 s",
         {"sample_before": (1.0, 20.0), "sample": (1.5, 25.1)}),
    Edge(battery.temperature_invalid, None, {"sample_before": (1.0, 20.0), "sample": (3.0, 10.0)}),
    Edge(battery.temperature_invalid, "the pack's temperature went from 20.0 to 9.9 °C in 2.00 s",
         {"sample_before": (1.0, 20.0), "sample": (3.0, 9.9)}),
    Edge(battery.temperature_invalid, None, {"sample": (3.0, 9.9)}),
    Edge(battery.status_trip, "the BMU reports over voltage, charge over current (status word 0x0005)",
         bmu={"status": 5.0}),
    Edge(battery.status_trip, None, bmu={"status": float(1 << 1 | 1 << 3 | 1 << 5)}),
    Edge(battery.status_limit, "the BMU reports low temperature, discharge over current (status word 0x0028)",
         bmu={"status": float(1 << 3 | 1 << 5)}),
    Edge(battery.status_limit, None, bmu={"status": None}),
    Edge(battery.implausible, "SOC 140 %; 99.00 V", bmu_link={
        "implausible": {"soc_pct": "SOC 140 %", "temperature_c": "-300 °C", "voltage_v": "99.00 V"}}),
    Edge(battery.implausible, None, bmu_link={"implausible": {"temperature_c": "-300 °C"}}),
    Edge(battery.implausible, None, bmu_link={"implausible": {"soc_pct": "SOC 140 %"}, "boot_t_s": ago(1)}),
    Edge(battery.needs_precharge, "the BMU reports low voltage and the policy has no precharge", policy=NO_PRECHARGE,
         bmu={"status": 2.0}),
    Edge(battery.needs_precharge, None, bmu={"status": 2.0}),
    Edge(battery.needs_precharge, None, policy=NO_PRECHARGE, bmu={"status": 5.0}),
    Edge(battery.needs_precharge, None, policy=NO_PRECHARGE, bmu={"status": None}),
    Edge(battery.hot_trip, None, bmu={"temperature_c": 54.9}),
    Edge(battery.hot_trip, f"the pack has 55.0 °C, at or above 55 °C ({AT('faults.temperature_trip_c')})",
         bmu={"temperature_c": 55.0}),
    Edge(battery.over_temperature, None, bmu={"temperature_c": 44.9}),
    Edge(battery.over_temperature,
         f"the pack has 45.0 °C, the limit is 45 °C ({AT('pack.temperature_c')}); it charges again below 40 °C",
         bmu={"temperature_c": 45.0}),
    Edge(battery.over_temperature, None, raised("over_temperature"), bmu={"temperature_c": 39.9}),
    Edge(battery.under_temperature, None, bmu={"temperature_c": 0.0}),
    Edge(battery.under_temperature,
         f"the pack has -0.1 °C, the limit is 0 °C ({AT('pack.temperature_c')}); it charges again at 3 °C",
         bmu={"temperature_c": -0.1}),
    Edge(battery.under_temperature,
         f"the pack has 2.9 °C, the limit is 0 °C ({AT('pack.temperature_c')}); it charges again at 3 °C",
         raised("under_temperature"), bmu={"temperature_c": 2.9}),
    Edge(battery.under_temperature, None, raised("under_temperature"), bmu={"temperature_c": 3.0}),
    Edge(battery.under_voltage, None, bmu={"voltage_v": 26.0}),
    Edge(battery.under_voltage, f"the pack has 25.90 V, below 26 V ({AT('pack.voltage_v')})",
         bmu={"voltage_v": 25.9}),
    Edge(battery.under_voltage, None, bmu={"voltage_v": None}),
    Edge(battery.soh_low, None, bmu={"soh_pct": 60.0}),
    Edge(battery.soh_low, f"SOH 59 %, below 60 % ({AT('pack.soh_min_pct')})", bmu={"soh_pct": 59.0}),
    Edge(battery.soh_low, None, bmu={"soh_pct": None}),
)  # fmt: skip

UNCONFIRMED = "the charger was told '{}' for {} s and its status does not show it"
OBEDIENCE = (
    Edge(obedience.will_not_start, None),
    Edge(obedience.will_not_start, None, order(RUN, 4.9)),
    Edge(obedience.will_not_start, UNCONFIRMED.format("run", "5.0"), order(RUN, 5)),
    Edge(obedience.will_not_start, UNCONFIRMED.format("run", "5.0"), order(Command(Action.RESUME), 5)),
    Edge(obedience.will_not_start, None, order(RUN, 9), State.STOPPING),
    Edge(obedience.will_not_start, None, order(LIMIT_3, 9)),
    Edge(obedience.will_not_start, UNCONFIRMED.format("run", "9.0") + "; the interlock held it back: too old",
         order(RUN, 9), charger_link={"refused": "too old"}),
    Edge(obedience.setting_not_obeyed, UNCONFIRMED.format("limit 3", "9.0"), order(LIMIT_3, 9)),
    Edge(obedience.setting_not_obeyed, None, order(LIMIT_3, 9), State.STOPPING),
    Edge(obedience.setting_not_obeyed, None, order(RUN, 9)),
    Edge(obedience.stopped_by_itself, None),
    Edge(obedience.stopped_by_itself, "the charger stopped though it was told to run",
         charger={"operation": Operation.STOPPED}),
    Edge(obedience.stopped_by_itself, None, {"ran": False}, charger={"operation": Operation.STOPPED}),
    Edge(obedience.stopped_by_itself, None, state=State.STOPPING, charger={"operation": Operation.STOPPED}),
    Edge(obedience.stopped_by_itself, None, charger={"operation": Operation.STOPPED, "t_s": ago(9)}),
    Edge(obedience.stopped_by_itself, None,
         charger={"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL}),
    Edge(obedience.found_running, "the charger was found running though it was not commanded to"),
    Edge(obedience.found_running, None, charger={"operation": Operation.STOPPED, "current_a": 0.5}),
    Edge(obedience.over_current, None, charger={"current_a": 14 * 110 / 100 + 0.3}),
    Edge(obedience.over_current, "15.71 A, more than 15.70 A for a limit of 14 A", charger={"current_a": 15.71}),
    Edge(obedience.over_current, "12.50 A, more than 12.40 A for a limit of 11 A",
         {"limit_before": 4, "limit_s": ago(1.1)}, charger={"current_a": 12.5, "current_limit": 3}),
    Edge(obedience.over_current, None, {"limit_before": 4, "limit_s": ago(1)},
         charger={"current_a": 12.5, "current_limit": 3}),
    Edge(obedience.over_current, "16.81 A, more than 16.80 A for a limit of 15 A",
         charger={"current_a": 16.81, "current_limit": None}),
    Edge(obedience.early_full, None, bmu={"soc_pct": 80.0}, charger={"charge_mode": ChargeMode.FULL}),
    Edge(obedience.early_full, "the charger reports full (mode 5), the BMU only 79 %", bmu={"soc_pct": 79.0},
         charger={"charge_mode": ChargeMode.FULL}),
    Edge(obedience.open_circuit, None),
    Edge(obedience.open_circuit, None, {"idle_a_s": ago(10)}),
    Edge(obedience.open_circuit, "the charger runs but has delivered nothing for 11 s at SOC 50 %",
         {"idle_a_s": ago(11)}),
    Edge(obedience.open_circuit, None, {"idle_a_s": ago(11)}, bmu={"soc_pct": 95.0}),
    Edge(obedience.open_circuit, None, {"idle_a_s": ago(11)}, bmu={"soc_pct": None}),
    Edge(obedience.no_battery, None, {"mode": 1, "mode_s": ago(90), "runs_s": ago(60)}),
    Edge(obedience.no_battery, None, {"mode": 1, "mode_s": ago(60), "runs_s": ago(90)}),
    Edge(obedience.no_battery, None, {"mode": 1, "mode_s": ago(90), "runs_s": None}),
    Edge(obedience.no_battery, "the charger has been looking for a battery for 2 min",
         {"mode": 1, "mode_s": ago(121), "runs_s": ago(999)}),
    *(Edge(obedience.wakes_too_long, "the charger has been in recovery or precharge for 31 min",
           {"mode": mode, "mode_s": ago(1860), "runs_s": ago(9999)}) for mode in (2, 3)),
    Edge(obedience.wakes_too_long, None, {"mode": 4, "mode_s": ago(1860), "runs_s": ago(9999)}),
)  # fmt: skip

SOC = (
    Edge(state_of_charge.soc_jump, None),
    Edge(state_of_charge.soc_jump, "a step", {"charge_step": (ago(899), "a step")}),
    Edge(state_of_charge.soc_jump, None, {"charge_step": (ago(900), "a step")}),
    Edge(state_of_charge.soc_falls, None, {"peak": (ago(899), 60.0)}),
    Edge(state_of_charge.soc_falls, None, {"peak": (ago(900), 51.9)}),
    Edge(state_of_charge.soc_falls, None, {"peak": (ago(900), 52.0)}, bmu={"soc_pct": None}),
    Edge(state_of_charge.soc_falls, "the SOC has fallen from 52 to 50 % in 15 min under charge",
         {"peak": (ago(900), 52.0)}),
    Edge(state_of_charge.soc_falls, "the SOC has fallen from 60 to 50 % in 60 min under charge",
         {"peak": (ago(3600), 60.0)}),
    Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 0.99, "available_wh": 1.0}),
    Edge(state_of_charge.figures_disagree,
         "the BMU has 1.00 Ah and 72.1 Wh available: that is 72.1 V, the pack has 48.00 V",
         bmu={"remaining_ah": 1.0, "available_wh": 72.1}),
    Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 1.0, "available_wh": 72.0}),
    Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 1.0, "available_wh": 32.0}),
    Edge(state_of_charge.figures_disagree,
         "the BMU has 1.00 Ah and 31.9 Wh available: that is 31.9 V, the pack has 48.00 V",
         bmu={"remaining_ah": 1.0, "available_wh": 31.9}),
    Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 20.0, "time_to_full_min": 360.0}),
    Edge(state_of_charge.figures_disagree,
         "the BMU says full in 366 min: that is 61.0 Ah, by 20.00 Ah at 50 % it is 20.0 Ah",
         bmu={"remaining_ah": 20.0, "time_to_full_min": 366.0}),
    Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 20.0, "time_to_full_min": 40.0}),
    Edge(state_of_charge.figures_disagree,
         "the BMU says full in 39 min: that is 6.5 Ah, by 20.00 Ah at 50 % it is 20.0 Ah",
         bmu={"remaining_ah": 20.0, "time_to_full_min": 39.0}),
    Edge(state_of_charge.figures_disagree, None,
         bmu={"remaining_ah": 20.0, "time_to_full_min": 3660.0, "current_a": 0.99}),
    Edge(state_of_charge.figures_disagree, "the BMU says full in 3660 min: that is 61.0 Ah, "
         "by 20.00 Ah at 50 % it is 20.0 Ah", bmu={"remaining_ah": 20.0, "time_to_full_min": 3660.0, "current_a": 1.0}),
    Edge(state_of_charge.figures_disagree, None,
         bmu={"remaining_ah": 2.0, "time_to_full_min": 999.0, "soc_pct": 9.9}),
    Edge(state_of_charge.figures_disagree, "the BMU says full in 600 min: that is 100.0 Ah, "
         "by 2.00 Ah at 10 % it is 18.0 Ah", bmu={"remaining_ah": 2.0, "time_to_full_min": 600.0, "soc_pct": 10.0}),
    Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 20.0, "time_to_full_min": 5.9}),
    Edge(state_of_charge.figures_disagree,
         "the BMU says full in 6 min: that is 1.0 Ah, by 20.00 Ah at 50 % it is 20.0 Ah",
         bmu={"remaining_ah": 20.0, "time_to_full_min": 6.0}),
    Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 3.0, "time_to_full_min": 6.0}),
    *(Edge(state_of_charge.figures_disagree, None, bmu={"remaining_ah": 20.0, "available_wh": 99.0, name: None})
      for name in ("remaining_ah", "soc_pct", "voltage_v", "current_a")),
    Edge(state_of_charge.soc_not_believed, None, raised("soc_jump")),
    Edge(state_of_charge.soc_not_believed, "text of soc_jump; text of figures_disagree",
         raised("figures_disagree", "soc_jump")),
    Edge(state_of_charge.battery_exchanged, None),
    Edge(state_of_charge.battery_exchanged, "a step, in which the BMU was not heard: this may be another battery",
         {"exchange": (ago(4.9), "a step")}),
    Edge(state_of_charge.battery_exchanged, None, {"exchange": (ago(5), "a step")}),
    Edge(state_of_charge.wrong_policy, None, bmu={"voltage_v": 38.0}),
    Edge(state_of_charge.wrong_policy, None, bmu={"voltage_v": 39.0, "soc_pct": 51.0}),
    Edge(state_of_charge.wrong_policy, "the pack has 38.00 V at SOC 51 %: below 39 V "
         f"({AT('precharge.below_v')}) a pack of 13 cells is empty", bmu={"voltage_v": 38.0, "soc_pct": 51.0}),
    Edge(state_of_charge.wrong_policy, None, bmu={"voltage_v": 38.0, "soc_pct": 51.0}, policy=NO_PRECHARGE),
    Edge(state_of_charge.wrong_policy, None, bmu={"voltage_v": None, "soc_pct": 51.0}),
    Edge(state_of_charge.wrong_policy, None, bmu={"voltage_v": 38.0, "soc_pct": None}),
)  # fmt: skip

FROZEN = "the charger has said 48.00 V and 10.00 A for 60 s, while the BMU's values moved by {} V and {} A: " \
         "its measurement is frozen"  # fmt: skip
PAIR = (
    Edge(pair.over_voltage, None, charger={"voltage_v": 55.2}, bmu={"voltage_v": 55.2}),
    Edge(pair.over_voltage, "55.21 V at the charger, the limit is 55.2 V", charger={"voltage_v": 55.21}),
    Edge(pair.over_voltage, "55.21 V at the pack, the limit is 55.2 V", bmu={"voltage_v": 55.21}),
    Edge(pair.over_voltage, None, charger={"t_s": ago(9)}, bmu={"voltage_v": None}),
    Edge(pair.volts_disagree, None, charger={"voltage_v": 49.0}),
    Edge(pair.volts_disagree,
         "the charger reads 49.01 V, the BMU 48.00 V: not the same battery, or a bad connection",
         charger={"voltage_v": 49.01}),
    Edge(pair.volts_disagree, None, charger={"voltage_v": 53.0}, bmu={"voltage_v": 54.08}),
    Edge(pair.volts_disagree, None, charger={"voltage_v": 9.0}, snapshot={"connected": False}),
    Edge(pair.volts_disagree, None, charger={"t_s": ago(9)}),
    Edge(pair.volts_disagree, None, bmu={"voltage_v": None}),
    Edge(pair.amps_disagree, None, bmu={"current_a": 9.0}),
    Edge(pair.amps_disagree, "the charger reads 10.00 A, the BMU 8.99 A", bmu={"current_a": 8.99}),
    Edge(pair.amps_disagree, None, charger={"current_a": 14.0}, bmu={"current_a": 12.61}),
    Edge(pair.amps_disagree, None, bmu={"current_a": None}),
    Edge(pair.amps_disagree, None, charger={"t_s": ago(9)}),
    Edge(pair.charger_frozen, None, still(59.9, 40.0, 1.0)),
    Edge(pair.charger_frozen, None, still(60, 47.9, 9.5)),
    Edge(pair.charger_frozen, None, still(60, 0.0, 10.0), bmu={"voltage_v": 0.2}),
    Edge(pair.charger_frozen, FROZEN.format("0.25", "0.00"), still(60, 47.75, 10.0)),
    Edge(pair.charger_frozen, FROZEN.format("0.00", "0.51"), still(60, 48.0, 10.51)),
    Edge(pair.charger_frozen, None, still(60, 40.0, 1.0), bmu={"voltage_v": None}),
    Edge(pair.charger_frozen, None, still(60, 40.0, 1.0), bmu={"current_a": None}),
    Edge(pair.charger_frozen, None),
    Edge(pair.back_feed, None, bmu={"current_a": -0.5}),
    Edge(pair.back_feed, "the BMU reports a discharge of 0.51 A while the charger runs", bmu={"current_a": -0.51}),
    Edge(pair.back_feed, None, {"runs_s": None}, bmu={"current_a": -0.51}),
    Edge(pair.back_feed, None, bmu={"current_a": None}),
)  # fmt: skip


def error_frame(bits: int, age_s: float = 1.0) -> dict[str, Any]:
    return {"error_bits": bits, "error_t_s": ago(age_s)}


REPORTS = (
    Edge(reports.rejected_frame, None, charger_link=error_frame(ErrorBit.COMMAND, 5.1)),
    Edge(reports.rejected_frame, "the charger answered with an error frame (0x1F): wrong command in what it received",
         charger_link=error_frame(ErrorBit.COMMAND, 5.0)),
    Edge(reports.rejected_frame,
         "the charger answered with an error frame (0x1F): wrong command and order in what it received",
         charger_link=error_frame(ErrorBit.COMMAND | ErrorBit.ORDER)),
    Edge(reports.rejected_frame, None, charger_link=error_frame(ErrorBit.COMMAND | ErrorBit.CHECKSUM)),
    Edge(reports.rejected_frame, None, charger_link=error_frame(ErrorBit.ORDER | ErrorBit.LENGTH)),
    Edge(reports.rejected_frame, None, charger_link=error_frame(0)),
    Edge(reports.rejected_frame, None, charger_link={"error_bits": 2}),
    Edge(reports.reverse_polarity,
         "the charger reports connection 0: the battery is connected the wrong way round",
         charger={"connection": Connection.REVERSED}),
    Edge(reports.reverse_polarity, "the charger reports mode 6: the battery is connected the wrong way round",
         charger={"charge_mode": ChargeMode.REVERSED}),
    Edge(reports.reverse_polarity, None),
    Edge(reports.polarity_contradicts,
         "the charger contradicts itself: mode 6 (battery reversed) with connection 1 (normal)",
         charger={"charge_mode": ChargeMode.REVERSED}),
    Edge(reports.polarity_contradicts, None,
         charger={"charge_mode": ChargeMode.REVERSED, "connection": Connection.REVERSED}),
    Edge(reports.error_stop, "the charger reports mode 8: stopped by an error of its own",
         charger={"charge_mode": ChargeMode.ERROR_STOP}),
    Edge(reports.error_stop, None),
    Edge(reports.system_stop, "the charger reports mode 7: it stopped itself without being asked",
         charger={"charge_mode": ChargeMode.SYSTEM_STOP}),
    Edge(reports.system_stop, None),
    Edge(reports.illegal_value, "the charger reports charge mode 9, precharge 3",
         charger={"illegal": ("charge mode 9", "precharge 3")}),
    Edge(reports.illegal_value, None),
    Edge(reports.mode_taken_over,
         "the charger is in automatic mode, the station file says manual: look at its rotary switch",
         charger={"control_mode": ControlMode.AUTOMATIC}),
    Edge(reports.mode_taken_over, None, charger={"control_mode": None}),
    Edge(reports.noisy_line, None, charger_link={"bad_pct": 5.0}),
    Edge(reports.noisy_line, "6 % of the last minute's exchanges with the charger went wrong, more than 5 %",
         charger_link={"bad_pct": 6.0}),
    Edge(ourselves.late, None, snapshot={"late_s": 0.4}),
    Edge(ourselves.late, "this bay was looked at 0.41 s late", snapshot={"late_s": 0.41}),
    Edge(ourselves.overrun, None, snapshot={"late_s": 1.0}),
    Edge(ourselves.overrun, "nobody looked at this bay for 1.1 s: the machine stood still",
         snapshot={"late_s": 1.1}),
    Edge(ourselves.suspended, None, snapshot={"slept_s": 2.0}),
    Edge(ourselves.suspended, "the machine was suspended for 3 s: nothing that is known of this bay holds any more",
         snapshot={"slept_s": 3.0}),
)  # fmt: skip


# --- where a bay goes next, and what it says --------------------------------------------------------------------------


def goes(f: Facts) -> Course:
    return course(f, latches.shown(f.memory.faults))


def holding(**changes: Any) -> dict[str, Any]:
    return {"step": Step(2, 8.0, "because"), **changes}


def reached(seconds: float) -> dict[str, Any]:
    return {"reached_s": ago(seconds), "mark_s": NOW_S}


STANDS_BY = {"operation": Operation.STOPPED, "current_a": 0.0}
STOP_SENT = {"stop_sent_s": ago(1)}
AT_REST: dict[str, Any] = {"charger": STANDS_BY, "charger_link": STOP_SENT}
SILENT_BMU: dict[str, Any] = {
    "bmu": dict.fromkeys(("voltage_v", "current_a", "status", "temperature_c", "soc_pct", "soh_pct")),
    "bmu_link": {"online": False},
}
FULL, SUSPENDED, OFFLINE, IDLE = State.FULL, State.SUSPENDED, State.OFFLINE, State.IDLE
QUALIFYING, STOPPING, STARTING, TRIPPED = State.QUALIFYING, State.STOPPING, State.STARTING, State.TRIPPED
CHECKING = "checking charger and battery before a charge"
NEVER = "the charger has not confirmed the stop for 3 s: {}"

GOES = (
    Edge(goes, (None, "step 2 (8.0 A): because"), holding()),
    Edge(goes, (None, "step 2 (8.0 A): because; a higher step is allowed, and taken after 60 s "
                f"({AT('current.raise_after_s')})"), holding(raise_s=ago(9))),
    Edge(goes, (None, "step 2 (8.0 A): because"), holding(**raised("soc_jump"))),
    Edge(goes, (None, "step 2 (8.0 A): because; text of status_limit; charging goes on, on the lowest step"),
         holding(**raised("status_limit"))),
    Edge(goes, (None, "the charger charges by itself (automatic mode)"), control=ControlMode.AUTOMATIC),
    Edge(goes, (None, "as before"), {"reason": "as before"}),
    Edge(goes, (Trigger.STOP, "paused by the operator"), holding(paused=True)),
    Edge(goes, (Trigger.STOP, "held"), holding(paused=True, hold="held")),
    Edge(goes, (Trigger.STOP, f"full: SOC 100 % reached 100 % ({AT('finish.soc_pct')})"), bmu={"soc_pct": 100.0}),
    Edge(goes, (None, f"the pack is below 39 V: pulse precharge ({AT('precharge.pulse')})"), reached(1.9), PULSE,
         bmu={"voltage_v": 35.1}),
    Edge(goes, (None, f"the pack is below 39 V: pulse precharge ({AT('precharge.pulse')})"), reached(9), PULSE,
         bmu={"voltage_v": 35.0}),
    Edge(goes, (Trigger.CONTINUE, f"the pack reached 35.1 V ({AT('precharge.pulse.until_v')})"), reached(2), PULSE,
         bmu={"voltage_v": 35.1}),
    Edge(goes, (None, f"the pack is below 39 V: pulse precharge ({AT('precharge.pulse')})"), {}, PULSE, 599.9,
         bmu={"voltage_v": 35.0}),
    Edge(goes, (Trigger.CONTINUE, f"10 min of pulses ({AT('precharge.pulse.max_min')})"), {}, PULSE, 600,
         bmu={"voltage_v": 35.0}),
    Edge(goes, (None, f"the pack is below 39 V: continuous precharge ({AT('precharge.continuous')})"), {}, CONTINUOUS,
         999, bmu={"voltage_v": 38.9}),
    Edge(goes, (Trigger.CHARGE, f"the pack reached 39 V ({AT('precharge.below_v')})"), reached(2), CONTINUOUS,
         bmu={"voltage_v": 39.0}),
    *(Edge(goes, (Trigger.STOP, "precharge without a rule for it, or without the pack's voltage"), {}, PULSE, **how)
      for how in ({"policy": NO_PRECHARGE}, {"bmu": {"voltage_v": None}})),
    Edge(goes, (None, "stopped for it"), {"reason": "stopped for it"}, STOPPING, 2.9),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("it delivers 10.00 A")), state=STOPPING, state_s=3),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("no answer on /dev/ttyX")), state=STOPPING, state_s=3,
         charger_link={"online": False}),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("no answer on /dev/ttyX")), state=STOPPING, state_s=3,
         charger={"t_s": ago(9)}),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("unplugged")), state=STOPPING, state_s=3,
         charger_link={"online": False, "problem": "unplugged"}),
    Edge(goes, (Trigger.GIVE_UP, NEVER.format("its status is not valid")), state=STOPPING, state_s=3,
         charger={"operation": None, "current_a": 0.0}),
    Edge(goes, (Trigger.LOSE, "the charger on /dev/ttyX does not answer"), {}, STARTING, 3,
         charger={"t_s": ago(9)}, charger_link={"online": False}),
    Edge(goes, (None, "still looking"), {"reason": "still looking"}, STARTING, 2.9, charger={"t_s": ago(9)},
         charger_link={"online": False}),
    Edge(goes, (Trigger.STOP, "the charger runs though it was not commanded to"), state=IDLE),
    Edge(goes, (None, "the charger is being stopped before anything else"), state=OFFLINE, charger=STANDS_BY),
    *(Edge(goes, (None, "the charger on /dev/ttyX does not answer"), {}, OFFLINE, **how) for how in (
        {"charger": {**STANDS_BY, "t_s": ago(9)}}, {"charger": STANDS_BY, "charger_link": {"online": False}})),
    Edge(goes, (Trigger.LOSE, "the charger on /dev/ttyX does not answer"), {}, IDLE, charger={"t_s": ago(9)}),
    Edge(goes, (Trigger.REST, "held"), {"hold": "held"}, FULL, **AT_REST),
    Edge(goes, (None, "held"), {"hold": "held"}, IDLE, **AT_REST),
    Edge(goes, (Trigger.SUSPEND, "paused by the operator; start to go on"), {"paused": True}, IDLE, **AT_REST),
    Edge(goes, (Trigger.RESET, "reset by the operator"), {}, TRIPPED, **AT_REST),
    Edge(goes, (Trigger.LOSE, "0.0 V at the charger, but the BMU (node 16) does not answer"), {}, IDLE,
         **SILENT_BMU, charger={**STANDS_BY, "voltage_v": 0.0}, charger_link=STOP_SENT, snapshot={"connected": False}),
    Edge(goes, (Trigger.LOSE, "48.0 V at the charger, but the BMU (node 16) has just booted"), {}, IDLE, **AT_REST,
         bmu=SILENT_BMU["bmu"], bmu_link={"online": False, "boot_t_s": ago(1)}),
    Edge(goes, (Trigger.LOSE, "48.0 V at the charger, but unplugged"), {}, IDLE, **AT_REST, bmu=SILENT_BMU["bmu"],
         bmu_link={"online": False, "problem": "unplugged"}),
    Edge(goes, (None, "no battery"), {}, IDLE, **SILENT_BMU, charger={**STANDS_BY, "voltage_v": 0.0},
         charger_link=STOP_SENT),
    Edge(goes, (None, "a battery is there; its SOC is not known yet"), {}, IDLE, **AT_REST, bmu={"soc_pct": None}),
    Edge(goes, (None, f"SOC 98 % is not below 98 % ({AT('start.soc_below_pct')})"), {}, IDLE, **AT_REST,
         bmu={"soc_pct": 98.0}),
    Edge(goes, (Trigger.QUALIFY, f"SOC 97 % is below 98 % ({AT('start.soc_below_pct')})"), {}, IDLE, **AT_REST,
         bmu={"soc_pct": 97.0}),
    Edge(goes, (Trigger.QUALIFY, f"SOC 99 % is below 100 % ({AT('finish.soc_pct')})"), session(), SUSPENDED, **AT_REST,
         bmu={"soc_pct": 99.0}),
    Edge(goes, (None, f"SOC 95 % is not below 95 % ({AT('recharge.soc_below_pct')})"), {"full_pct": 100.0}, FULL,
         **AT_REST, bmu={"soc_pct": 95.0}),
    Edge(goes, (None, f"SOC 87 % is not below 87 % ({AT('recharge.soc_below_pct')})"), {"full_pct": 90.0}, FULL,
         **AT_REST, bmu={"soc_pct": 87.0}),
    Edge(goes, (Trigger.QUALIFY, f"SOC 86 % is below 87 % ({AT('recharge.soc_below_pct')})"), {"full_pct": 90.0}, FULL,
         **AT_REST, bmu={"soc_pct": 86.0}),
    Edge(goes, (None, "waiting for fresh values: SOH"), {}, QUALIFYING, **AT_REST, bmu={"soh_pct": None}),
    Edge(goes, (None, "waiting for the contactor, behind which charger and battery cannot be compared"), {}, QUALIFYING,
         **AT_REST, snapshot={"connected": False}),
    Edge(goes, (None, CHECKING), {}, QUALIFYING, **AT_REST),
    Edge(goes, (None, CHECKING), {"qualified_s": ago(1.9)}, QUALIFYING, **AT_REST),
    Edge(goes, (Trigger.CHARGE, "qualified: 48.00 V, SOC 50 %, 20.0 °C"), {"qualified_s": ago(2)}, QUALIFYING,
         **AT_REST),
    Edge(goes, (Trigger.CHARGE, "qualified: 39.00 V, SOC 50 %, 20.0 °C"), {"qualified_s": ago(2)}, QUALIFYING,
         **AT_REST, bmu={"voltage_v": 39.0}),
    Edge(goes, (Trigger.PULSE, f"the pack has 38.90 V, below 39 V ({AT('precharge.below_v')})"),
         {"qualified_s": ago(2)}, QUALIFYING, **AT_REST, bmu={"voltage_v": 38.9}),
)  # fmt: skip


@pytest.mark.parametrize(("minutes", "marked_s"), [(5.0, NOW_S), (4.99, ago(4.99 * 60))])
def test_a_pack_that_rose_is_looked_at_from_then_on(minutes: float, marked_s: float) -> None:
    f = Edge(goes, None, marked(minutes, 34.0), PULSE, bmu={"voltage_v": 35.0}).facts
    goes(f)
    assert (f.memory.mark_s, f.memory.mark_v) == (marked_s, 35.0 if marked_s == NOW_S else 34.0)


# --- what is followed from step to step -------------------------------------------------------------------------------


def followed(name: str) -> Callable[[Facts], object]:
    """What the memory says under this name, once it was brought up to these facts."""

    def rule(f: Facts) -> object:
        follow(f, ago(0.25))
        return getattr(f.memory, name)

    rule.__name__ = name
    return rule


idle_a_s, still_values, peak = followed("idle_a_s"), followed("still"), followed("peak")
charge_step, exchange, counted = followed("charge_step"), followed("exchange"), followed("session")
STILL = Still(NOW_S, 48.0, 10.0, 48.0, 10.0)
BEGUN = Session(
    ago(100), energised_s=90.0, charged_ah=1.0, charged_wh=48.0, soc_start_pct=40.0, soc_pct=49.0, step_changes=1
)
NOW = replace(BEGUN, elapsed_s=100.0, energised_s=90.25, soc_pct=50.0)
FOLLOWS = (
    Edge(idle_a_s, None, charger={"current_a": 0.1}),
    Edge(idle_a_s, NOW_S, charger={"current_a": 0.09}),
    Edge(idle_a_s, ago(5), {"idle_a_s": ago(5)}, charger={"current_a": 0.0}),
    Edge(idle_a_s, None, charger={"current_a": 0.0, "operation": Operation.STOPPED}),
    Edge(idle_a_s, None, charger={"current_a": 0.0, "charge_mode": ChargeMode.BATTERY_SEARCH}),
    Edge(still_values, STILL),
    Edge(still_values, replace(STILL, t_s=ago(9)), {"still": replace(STILL, t_s=ago(9))}),
    Edge(still_values, STILL, {"still": replace(STILL, t_s=ago(9), volts=48.1)}),
    Edge(still_values, STILL, {"still": replace(STILL, t_s=ago(9), amps=10.1)}),
    Edge(still_values, replace(STILL, amps=1.1), charger={"current_a": 1.1}),
    Edge(still_values, None, {"still": STILL}, charger={"current_a": 1.0}),
    Edge(still_values, None, {"still": STILL}, charger={"t_s": ago(9)}),
    Edge(still_values, None, {"still": STILL}, charger={"current_a": math.nan}),
    *(Edge(still_values, None, {"still": STILL}, bmu={name: None}) for name in ("voltage_v", "current_a")),
    Edge(peak, (NOW_S, 50.0)),
    Edge(peak, (ago(9), 50.1), {"peak": (ago(9), 50.1)}),
    Edge(peak, (NOW_S, 50.0), {"peak": (ago(9), 50.0)}),
    Edge(peak, None, {"peak": (ago(9), 50.1)}, state=State.STOPPING),
    Edge(peak, None, {"peak": (ago(9), 50.1)}, bmu={"current_a": 1.0}),
    Edge(peak, None, {"peak": (ago(9), 50.1)}, bmu={"current_a": None}),
    Edge(peak, None, {"peak": (ago(9), 50.1)}, bmu={"soc_pct": None}),
    Edge(charge_step, None, {"charge": (ago(3), 42.0)}),
    Edge(charge_step, (NOW_S, "the SOC went from 42 to 50 % in 3 s"), {"charge": (ago(3), 41.9)}),
    Edge(charge_step, (NOW_S, "the SOC went from 58 to 50 % in 3 s"), {"charge": (ago(3), 58.1)}),
    Edge(charge_step, None, {"charge": (ago(3), None)}),
    Edge(charge_step, None, {"charge": (ago(3.1), 1.0)}),
    Edge(exchange, None, {"charge": (ago(3), 1.0)}),
    Edge(exchange, None, {"charge": (ago(30), 39.0)}),
    Edge(exchange, (NOW_S, "the SOC went from 39 to 50 % in 30 s"), {"charge": (ago(30), 38.9)}),
    Edge(exchange, None, {"charge": (ago(30), 1.0), "boots": 1}),
    Edge(counted, None),
    Edge(counted, NOW, {"session": BEGUN, "counted_t_s": NOW_S}),
    Edge(counted, NOW, {"session": BEGUN, "counted_t_s": None}),
    Edge(counted, replace(NOW, charged_ah=1 + 10 / 3600, charged_wh=48 + 480 / 3600),
         {"session": BEGUN, "counted_t_s": ago(1)}),
    Edge(counted, replace(NOW, charged_ah=1 + 10 * 1.5 / 3600, charged_wh=48 + 10 * 48 * (1.5 / 3600)),
         {"session": BEGUN, "counted_t_s": ago(9)}),
    Edge(counted, NOW, {"session": BEGUN, "counted_t_s": ago(1)}, charger={"t_s": ago(9)}),
    Edge(counted, replace(NOW, energised_s=90.0), {"session": BEGUN, "counted_t_s": ago(1)}, State.STOPPING,
         charger={"operation": Operation.STOPPED, "current_a": 0.4}),
    Edge(counted, replace(NOW, soc_pct=49.0), {"session": BEGUN, "counted_t_s": NOW_S}, bmu={"soc_pct": None}),
)  # fmt: skip


def test_the_first_step_lasts_no_time() -> None:
    f = Edge(goes, None, {"session": BEGUN, "counted_t_s": NOW_S}).facts
    follow(f, None)
    assert f.memory.session == replace(NOW, energised_s=90.0)


@pytest.mark.parametrize(
    ("t_s", "value"), [(ago(1.5), 48.0), (ago(1.51), None), (NOW_S + 1.5, 48.0), (NOW_S + 1.51, None)]
)
def test_a_value_counts_while_it_is_fresh_and_not_from_the_future(t_s: float, value: float | None) -> None:
    battery = replace(BMU, voltage_v=Measurement(48.0, t_s))
    assert Facts(NOW_S, Snapshot(battery=battery), Memory(), Rules.of(bay())).pack_v == value


def test_a_fault_of_the_first_moment_is_shown_from_then_on() -> None:
    (fault,) = latches.shown({"soh_low": FaultMemory(raised_s=0.0)})
    assert fault.since_s == 0.0


def test_a_copy_of_a_memory_is_its_own() -> None:
    memory = Memory(faults={"soh_low": FaultMemory()})
    memory.copy().faults.clear()
    assert memory.faults


@pytest.mark.parametrize(
    ("kept", "after"),
    [
        ((), ((1000.0, 30.0),)),
        (((990.1, 20.0),), ((990.1, 20.0),)),
        (((990.0, 20.0),), ((990.0, 20.0), (1000.0, 30.0))),
        (((810.0, 20.0), (990.0, 25.0)), ((810.0, 20.0), (990.0, 25.0), (1000.0, 30.0))),
        (((809.9, 20.0), (990.0, 25.0)), ((990.0, 25.0), (1000.0, 30.0))),
    ],
)
def test_temperatures_are_kept_ten_seconds_apart_for_three_minutes(kept: Warmth, after: Warmth) -> None:
    assert thinned(kept, (1000.0, 30.0)) == after


@pytest.mark.parametrize(("charger", "counted_t_s"), [({}, NOW_S), ({"t_s": ago(9)}, None)])
def test_a_session_counts_from_its_beginning(charger: dict[str, Any], counted_t_s: float | None) -> None:
    f = Edge(goes, None, bmu={"voltage_v": None}, charger=charger).facts
    follow_state(f, QUALIFYING)
    assert f.memory.session == Session(NOW_S, soc_start_pct=50.0, soc_pct=50.0)
    assert f.memory.counted_t_s == counted_t_s
    assert (f.memory.mark_s, f.memory.mark_v) == (NOW_S, 0.0)


EDGES = (*CHARGE, *FINISH, *BATTERY, *OBEDIENCE, *SOC, *PAIR, *REPORTS, *GOES, *FOLLOWS)


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: f"{edge.rule.__name__}-{edge.says}")
def test_a_rule_at_its_edge(edge: Edge) -> None:
    assert edge.rule(edge.facts) == edge.says


def test_every_rule_with_a_number_has_its_edges() -> None:
    asked = {edge.rule for edge in EDGES if edge.says and edge.rule is not goes}
    assert {edge.rule for edge in EDGES if not edge.says} == asked
