"""Every rule at its edge: the last value that is no fault, the first one that is, and the whole sentence.

The scenes of `test_faults.py` show what a fault leads to; here the rules are applied alone, to facts made by hand.
"""

from dataclasses import replace
from typing import Any

import pytest

from orchestrator.config.policy import Policy
from orchestrator.core.checks import battery, charge, obedience, ourselves, reports, state_of_charge
from orchestrator.core.finish import ends_full, finished, known_full, tapers
from orchestrator.core.memory import Still
from orchestrator.core.sequence import RESUME, RUN
from orchestrator.core.witnesses import measured
from orchestrator.core.witnesses.followed import Sample
from orchestrator.model import (
    Action,
    BatteryReading,
    ChargeMode,
    Command,
    Connection,
    ControlMode,
    CurrentStep,
    ErrorBit,
    Measurement,
    Operation,
    Session,
    State,
)
from tests.core.bays import POLICY
from tests.core.edges import AT, CONTINUOUS, NO_PRECHARGE, PULSE, Edge, ago, marked, raised, session, witnessed
from tests.core.said import cause, said
from tests.core.world import with_full

LIMIT_3 = Command(Action.SET_LIMIT, 3)


def heart(age_s: float, nmt_state: int | None = 5) -> dict[str, Any]:
    return {"heartbeat_s": 0.5, "heartbeat_t_s": ago(age_s), "nmt_state": nmt_state}


def command(command: Command, seconds: float) -> dict[str, Any]:
    return {"command": command, "command_s": ago(seconds)}


def still(seconds: float, pack_v: float, pack_a: float) -> dict[str, Any]:
    return {"still": Still(ago(seconds), 48.0, 10.0, pack_v, pack_a)}


assert POLICY.precharge is not None
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
    Edge(charge.precharge_no_rise, None, {}, PULSE),
    Edge(charge.precharge_no_rise, None, {"session": Session(0.0, rise_s=9999)}, PULSE),
    Edge(charge.precharge_too_long, None, state=CONTINUOUS),
    Edge(charge.precharge_too_long, None, {"session": Session(0.0, continuous_s=1200)}, CONTINUOUS),
    Edge(charge.precharge_too_long, None, {"session": Session(0.0, pulse_s=9999)}, CONTINUOUS),
    Edge(charge.precharge_too_long, None, {"session": Session(0.0, continuous_s=1206)}, PULSE),
    Edge(charge.precharge_too_long, None, {"session": Session(0.0, continuous_s=1206)}, CONTINUOUS,
         policy=NO_PRECHARGE),
    Edge(charge.precharge_too_long, "continuous precharge has taken 20.1 min and the pack is below 39 V "
         f"({AT('precharge.continuous.max_min')})", {"session": Session(0.0, continuous_s=1206)}, CONTINUOUS),
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


def trail(*samples: tuple[float, float, float, float]) -> dict[str, Any]:
    """Seconds ago, the pack's volts and amps, the charger's amps; oldest first."""
    seen = tuple(Sample(ago(age_s), pack_v, pack_a, pack_v, amps) for age_s, pack_v, pack_a, amps in samples)
    return {**witnessed(trail=seen), "step": CurrentStep(4, 14.0, cause(""))}


TAPERED = trail((5.0, 53.0, 6.9, 6.9), (0.0, 53.0, 6.9, 6.9))
FINISH = (
    Edge(ends_full, True, TAPERED),
    Edge(ends_full, False, trail((4.9, 53.0, 6.9, 6.9), (0.0, 53.0, 6.9, 6.9))),
    Edge(ends_full, False, trail((9.0, 53.0, 14.0, 14.0), (0.0, 53.0, 7.0, 7.0))),
    Edge(ends_full, True, trail((9.0, 53.0, 14.0, 14.0), (0.5, 53.0, 6.9, 6.9), (0.0, 53.0, 0.0, 0.0))),
    Edge(ends_full, False, trail((9.0, 53.0, 0.0, 0.0), (0.0, 53.0, 0.0, 0.0))),
    Edge(ends_full, True, trail((1.0, 53.6, 14.0, 14.0), (0.0, 53.0, 14.0, 14.0))),
    Edge(ends_full, False, trail((1.0, 53.59, 14.0, 14.0), (0.0, 53.0, 14.0, 14.0))),
    Edge(ends_full, True, bmu={"voltage_v": 53.6}),
    Edge(ends_full, False, bmu={"voltage_v": None}),
    Edge(ends_full, True, trail((1.0, 52.97, 14.0, 14.0)),
         policy=with_full(taper=None)),
    Edge(ends_full, False, trail((1.0, 52.95, 14.0, 14.0)),
         policy=with_full(taper=None)),
    Edge(finished, None, bmu={"soc_pct": 99.9}),
    Edge(finished, None, bmu={"soc_pct": None}),
    Edge(known_full, f"SOC 100 % reached 100 % ({AT('finish.full.soc_pct')})", bmu={"soc_pct": 100.0}),
    Edge(finished, None, bmu={"soc_pct": 79.9}, charger={"charge_mode": ChargeMode.FULL}),
    Edge(finished, f"the charger reports full (mode 5) ({AT('finish.full.charger')})", TAPERED,
         bmu={"soc_pct": 80.0}, charger={"charge_mode": ChargeMode.FULL}),
    Edge(finished, None, bmu={"soc_pct": 80.0}, charger={"charge_mode": ChargeMode.FULL}),
    Edge(finished, None, TAPERED, bmu={"soc_pct": 80.0}, charger={"charge_mode": ChargeMode.FULL},
         policy=with_full(charger=False)),
    Edge(known_full, None, {"taper_s": ago(119.9)}),
    Edge(known_full, f"10.00 A, tapered below 1 A for 120 s ({AT('finish.full.taper')})", {"taper_s": ago(120)}),
    Edge(known_full, None, {"taper_s": ago(120)},
         policy=with_full(taper=None)),
    Edge(tapers, True, charger={"current_a": 0.99}, bmu={"voltage_v": 53.61}),
    Edge(tapers, False, charger={"current_a": 1.0}, bmu={"voltage_v": 53.61}),
    Edge(tapers, False, charger={"current_a": 0.99}, bmu={"voltage_v": 53.6}),
    Edge(tapers, False, charger={"current_a": 0.99}, bmu={"voltage_v": None}),
    Edge(tapers, False, charger={"current_a": 0.99, "t_s": ago(9)}, bmu={"voltage_v": 53.61}),
    Edge(tapers, False, {}, charger={"operation": Operation.STOPPED, "current_a": 0.49}, bmu={"voltage_v": 53.61}),
    Edge(tapers, False, charger={"current_a": 0.99}, bmu={"voltage_v": 53.61},
         policy=with_full(taper=None)),
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
        "implausible": {
            "soc_pct": cause("SOC 140 %"), "temperature_c": cause("-300 °C"), "voltage_v": cause("99.00 V")}}),
    Edge(battery.implausible, None, bmu_link={"implausible": {"temperature_c": cause("-300 °C")}}),
    Edge(battery.implausible, None, bmu_link={"implausible": {"soc_pct": cause("SOC 140 %")}, "boot_t_s": ago(1)}),
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
         bmu={"voltage_v": 25.9, "soc_pct": 3.0}),
    Edge(battery.under_voltage, None, bmu={"voltage_v": 25.9}),  # that is another pack
    Edge(battery.under_voltage, None, bmu={"voltage_v": None}),
    Edge(battery.soh_low, None, bmu={"soh_pct": 60.0}),
    Edge(battery.soh_low, f"SOH 59 %, below 60 % ({AT('pack.soh_min_pct')})", bmu={"soh_pct": 59.0}),
    Edge(battery.soh_low, None, bmu={"soh_pct": None}),
)  # fmt: skip

NOT_ASKED = (
    "the charger stopped though it was told to run, and the policy does not take its mode 5 for full "
    f"({with_full(charger=False).source.at('finish.full.charger')})"
)
NOT_FULL = "the charger stopped though it was told to run, and its mode 5 is not taken for full: the current had not " \
           "tapered off and the pack has not reached its end voltage"  # fmt: skip
UNCONFIRMED = "the charger was told '{}' for {} s and its status does not show it"
OBEDIENCE = (
    Edge(obedience.will_not_start, None),
    Edge(obedience.will_not_start, None, command(RUN, 4.9)),
    Edge(obedience.will_not_start, UNCONFIRMED.format("run", "5.0"), command(RUN, 5)),
    Edge(obedience.will_not_start, UNCONFIRMED.format("run", "5.0"), command(RESUME, 5)),
    Edge(obedience.will_not_start, None, command(RUN, 9), State.STOPPING),
    Edge(obedience.will_not_start, None, command(LIMIT_3, 9)),
    Edge(obedience.will_not_start, UNCONFIRMED.format("run", "9.0") + "; the interlock holds it back: too old",
         command(RUN, 9), charger_link={"refused": cause("too old")}),
    Edge(obedience.setting_not_obeyed, UNCONFIRMED.format("step 4", "9.0"), command(LIMIT_3, 9)),
    Edge(obedience.setting_not_obeyed, None, command(LIMIT_3, 9), State.STOPPING),
    Edge(obedience.setting_not_obeyed, None, command(RUN, 9)),
    Edge(obedience.stopped_by_itself, None),
    Edge(obedience.stopped_by_itself, "the charger stopped though it was told to run",
         charger={"operation": Operation.STOPPED}),
    Edge(obedience.stopped_by_itself, None, {"ran": False}, charger={"operation": Operation.STOPPED}),
    Edge(obedience.stopped_by_itself, None, state=State.STOPPING, charger={"operation": Operation.STOPPED}),
    Edge(obedience.stopped_by_itself, None, charger={"operation": Operation.STOPPED, "t_s": ago(9)}),
    Edge(obedience.stopped_by_itself, NOT_FULL, bmu={"soc_pct": 85.0},
         charger={"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL}),
    Edge(obedience.stopped_by_itself, None, TAPERED, bmu={"soc_pct": 85.0},
         charger={"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL}),
    Edge(obedience.stopped_by_itself, NOT_ASKED, TAPERED, bmu={"soc_pct": 85.0},
         charger={"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL},
         policy=with_full(charger=False)),
    Edge(obedience.stopped_by_itself, NOT_FULL, bmu={"soc_pct": 79.0},
         charger={"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL}),
    Edge(obedience.stopped_by_itself, None, TAPERED, bmu={"soc_pct": 79.0},  # that is early_full
         charger={"operation": Operation.STOPPED, "charge_mode": ChargeMode.FULL}),
    Edge(obedience.found_running, "the charger was found running though it was not commanded to"),
    Edge(obedience.found_running, None, charger={"operation": Operation.STOPPED, "current_a": 0.5}),
    Edge(obedience.over_current, None, charger={"current_a": 14 * 110 / 100 + 0.3}),
    Edge(obedience.over_current, "15.71 A, more than 15.70 A for a limit of 14 A", charger={"current_a": 15.71}),
    Edge(obedience.over_current, "12.50 A, more than 12.40 A for a limit of 11 A",
         {"limit_before": 4, "limit_s": ago(1.1)}, charger={"current_a": 12.5, "current_step": 3}),
    Edge(obedience.over_current, None, {"limit_before": 4, "limit_s": ago(1)},
         charger={"current_a": 12.5, "current_step": 3}),
    Edge(obedience.over_current, "16.81 A, more than 16.80 A for a limit of 15 A",
         charger={"current_a": 16.81, "current_step": None}),
    Edge(obedience.early_full, None, TAPERED, bmu={"soc_pct": 80.0}, charger={"charge_mode": ChargeMode.FULL}),
    Edge(obedience.early_full, None, bmu={"soc_pct": 79.0}, charger={"charge_mode": ChargeMode.FULL}),
    Edge(obedience.early_full, "the charger reports full (mode 5), the BMU only 79 %", TAPERED, bmu={"soc_pct": 79.0},
         charger={"charge_mode": ChargeMode.FULL}),
    Edge(obedience.open_circuit, None),
    Edge(obedience.open_circuit, None, {"idle_s": 10.0}),
    Edge(obedience.open_circuit, "the charger runs but has delivered nothing for 11 s at SOC 50 %",
         {"idle_s": 11.0}),
    Edge(obedience.open_circuit, None, {"idle_s": 11.0}, bmu={"soc_pct": 95.0}),
    Edge(obedience.open_circuit, None, {"idle_s": 11.0}, bmu={"soc_pct": None}),
    Edge(obedience.no_battery, None, {"search_s": 60.0}),
    Edge(obedience.no_battery, "the charger has been looking for a battery for 2 min", {"search_s": 121.0}),
    Edge(obedience.wakes_too_long, None, {"wake_s": 1800.0}),
    Edge(obedience.wakes_too_long, "the charger has been in recovery or precharge for 31 min", {"wake_s": 1860.0}),
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
         {"exchange": (ago(4.9), cause("a step"))}),
    Edge(state_of_charge.battery_exchanged, None, {"exchange": (ago(5), cause("a step"))}),
)  # fmt: skip

FROZEN = "the charger has said 48.00 V and 10.00 A for 60 s, while the BMU's values moved by {} V and {} A: " \
         "its measurement is frozen"  # fmt: skip
DIFFERS = "the charger reads 48.51 V, the BMU 48.00 V: not the same battery, or a bad connection"


def with_faults(**stricter: float) -> Policy:
    return replace(POLICY, faults=replace(POLICY.faults, **stricter))


PAIR = (
    Edge(measured.over_voltage, None, charger={"voltage_v": 55.2}, bmu={"voltage_v": 55.2}),
    Edge(measured.over_voltage, "55.21 V at the charger, the limit is 55.2 V", charger={"voltage_v": 55.21}),
    Edge(measured.over_voltage, "55.21 V at the pack, the limit is 55.2 V", bmu={"voltage_v": 55.21}),
    Edge(measured.over_voltage, None, charger={"t_s": ago(9)}, bmu={"voltage_v": None}),
    Edge(measured.volts_disagree, None, charger={"voltage_v": 49.0}),
    Edge(measured.volts_disagree, DIFFERS.replace("48.51", "53.00"), charger={"voltage_v": 53.0},
         bmu={"soc_pct": None}),
    Edge(measured.volts_disagree,
         "the charger reads 49.01 V, the BMU 48.00 V: not the same battery, or a bad connection",
         charger={"voltage_v": 49.01}),
    Edge(measured.volts_disagree, None, charger={"voltage_v": 53.0}, bmu={"voltage_v": 54.08}),
    Edge(measured.volts_disagree, None, charger={"voltage_v": 48.5}, policy=with_faults(volts_differ_v=0.5)),
    Edge(measured.volts_disagree, DIFFERS, charger={"voltage_v": 48.51}, policy=with_faults(volts_differ_v=0.5)),
    Edge(measured.volts_disagree, DIFFERS, charger={"voltage_v": 48.51}, policy=with_faults(volts_differ_pct=1.0)),
    Edge(measured.volts_disagree, DIFFERS, charger={"voltage_v": 48.51},
         policy=with_faults(volts_differ_v=1.0, volts_differ_pct=1.0)),
    Edge(measured.volts_disagree, None, charger={"voltage_v": 9.0}, snapshot={"connected": False}),
    Edge(measured.volts_disagree, None, charger={"t_s": ago(9)}),
    Edge(measured.volts_disagree, None, bmu={"voltage_v": None}),
    Edge(measured.amps_disagree, None, bmu={"current_a": 9.0}),
    Edge(measured.amps_disagree, "the charger reads 10.00 A, the BMU 8.00 A; the charger is likelier wrong, by the "
         "step that was set (8 A)", {"step": CurrentStep(2, 8.0, cause(""))}, bmu={"current_a": 8.0}),
    Edge(measured.amps_disagree, "the charger reads 10.00 A, the BMU 14.00 A; the BMU is likelier wrong, by the step "
         "that was set (10 A)", {"step": CurrentStep(2, 10.0, cause(""))}, bmu={"current_a": 14.0}),
    Edge(measured.amps_disagree, "the charger reads 10.00 A, the BMU 14.00 A", {"step": CurrentStep(2, 2.0, cause(""))},
         bmu={"current_a": 14.0}),
    Edge(measured.amps_disagree, "the charger reads 10.00 A, the BMU 8.99 A", bmu={"current_a": 8.99}),
    Edge(measured.amps_disagree, None, charger={"current_a": 14.0}, bmu={"current_a": 12.61}),
    Edge(measured.amps_disagree, None, bmu={"current_a": None}),
    Edge(measured.amps_disagree, None, charger={"t_s": ago(9)}),
    Edge(measured.charger_frozen, None, still(59.9, 40.0, 1.0)),
    Edge(measured.charger_frozen, None, still(60, 47.9, 9.5)),
    Edge(measured.charger_frozen, None, still(60, 0.0, 10.0), bmu={"voltage_v": 0.2}),
    Edge(measured.charger_frozen, FROZEN.format("0.25", "0.00"), still(60, 47.75, 10.0)),
    Edge(measured.charger_frozen, FROZEN.format("0.00", "0.51"), still(60, 48.0, 10.51)),
    Edge(measured.charger_frozen, None, still(60, 40.0, 1.0), bmu={"voltage_v": None}),
    Edge(measured.charger_frozen, None, still(60, 40.0, 1.0), bmu={"current_a": None}),
    Edge(measured.charger_frozen, None),
    Edge(measured.back_feed, None, bmu={"current_a": -0.5}),
    Edge(measured.back_feed, "the BMU reports a discharge of 0.51 A while the charger runs", bmu={"current_a": -0.51}),
    Edge(measured.back_feed, None, {"runs_s": None}, bmu={"current_a": -0.51}),
    Edge(measured.back_feed, None, bmu={"current_a": None}),
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
         charger={"illegal": (cause("charge mode 9"), cause("precharge 3"))}),
    Edge(reports.illegal_value, None),
    Edge(reports.mode_taken_over,
         "the charger is in automatic mode, the station file says manual",
         charger={"control_mode": ControlMode.AUTOMATIC}),
    Edge(reports.mode_taken_over, None, charger={"control_mode": None}),
    Edge(reports.noisy_line, None, charger_link={"bad_pct": 5.0}),
    Edge(reports.noisy_line, "6 % of the last minute's exchanges with the charger go wrong, more than 5 %",
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


EDGES = (*CHARGE, *FINISH, *BATTERY, *OBEDIENCE, *SOC, *PAIR, *REPORTS)


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: edge.name)
def test_a_rule_at_its_edge(edge: Edge) -> None:
    assert said(edge.rule(edge.facts)) == edge.says


def test_every_rule_with_a_number_has_its_edges() -> None:
    asked = {edge.rule for edge in EDGES if edge.says}
    assert {edge.rule for edge in EDGES if not edge.says} == asked
