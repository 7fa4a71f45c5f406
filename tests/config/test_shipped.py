"""The files shipped with the program: valid, complete, and in agreement with the README."""

import re
from pathlib import Path

import pytest

from orchestrator.config.amperes import max_hours, row_a
from orchestrator.config.load import check, load_map, load_policy, load_scenario, load_station
from orchestrator.config.northbound import Northbound, Page, Tls, User
from orchestrator.config.policy import (
    Finish,
    Full,
    Pack,
    Policy,
    PrechargeRule,
    Recharge,
    Start,
    Table,
    Taper,
    Thresholds,
    Where,
)
from orchestrator.config.scenario import Ask, BatteryModel, ChargerModel, Scenario, SensorFault, Visit, Weather
from orchestrator.config.shipped import shipped_dir, shipped_names
from orchestrator.config.yaml.schema import slots
from orchestrator.keys import Range
from orchestrator.model import ControlMode
from orchestrator.protocol.objects import Evidence, ObjectMap

POLICIES = (
    "agv-lfp-48v-100ah", "e-bike-36v", "lfp-48v", "li-ion-24v", "li-ion-48v", "long-life-48v", "telecom-lfp-15s",
)  # fmt: skip
MAPS = ("tabos", "tabos-lsb")
STATIONS = ("one-bay", "two-bays-rs485")
NORTHBOUND = ("page",)
SCENARIOS = ("aged-pack", "agv-day", "cold-morning", "deep-discharge", "faulty-sensor", "hot-afternoon")


def test_the_shipped_names_are_these() -> None:
    assert shipped_names("policies") == POLICIES
    assert shipped_names("configs/maps") == MAPS
    assert shipped_names("configs/stations") == STATIONS
    assert shipped_names("configs/scenarios") == SCENARIOS
    assert shipped_names("configs/northbound") == NORTHBOUND


def test_all_shipped_files_pass_the_check() -> None:
    folders = ("policies", "configs/maps", "configs/stations", "configs/scenarios", "configs/northbound")
    files = [path for folder in folders for path in _files(folder)]
    assert len(files) == len(POLICIES) + len(MAPS) + len(STATIONS) + len(SCENARIOS) + len(NORTHBOUND)
    assert check(files) == []


def _files(folder: str) -> list[Path]:
    return list((shipped_dir() / folder).glob("*.yaml"))


@pytest.mark.parametrize("name", POLICIES)
def test_a_policy_is_called_as_its_file(name: str) -> None:
    policy = load_policy(name)
    assert policy.policy == name
    assert policy.source.file == f"policies/{name}.yaml"


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_scenario_is_called_as_its_file(name: str) -> None:
    assert load_scenario(name).scenario == name


def test_one_scenario_shows_every_key() -> None:
    """Where keys are explained, none is left out, be it in a comment."""
    text = (shipped_dir() / "configs/scenarios/cold-morning.yaml").read_text(encoding="utf-8")
    for record in (Scenario, ChargerModel, BatteryModel, Weather, Visit, SensorFault, Ask):
        for name in slots(record):
            assert re.search(rf"\b{name}\b", text), name


def test_the_northbound_file_shows_every_key() -> None:
    text = (shipped_dir() / "configs/northbound/page.yaml").read_text(encoding="utf-8")
    for record in (Northbound, Page, Tls, User):
        for name in slots(record):
            assert re.search(rf"\b{name}\b", text), name


@pytest.mark.parametrize("name", POLICIES)
def test_over_voltage_leaves_the_charger_room_above_its_end_voltage(name: str) -> None:
    """A limit equal to the end voltage would latch at the end of every charge."""
    pack = load_policy(name).pack
    full_v = 3.55 if "lfp" in name else 4.2
    assert pack.voltage_v.high >= pack.cells_in_series * full_v * 1.005


def test_li_ion_48v_is_what_was_agreed() -> None:
    policy = load_policy("li-ion-48v")
    assert policy.pack.cells_in_series == 13
    assert policy.pack.soh_min_pct == 60
    assert policy.pack.temperature_c == Range(0, 45)
    assert policy.precharge is not None
    assert policy.precharge.below_v == 39.0
    assert policy.precharge.pulse.max_min == 10
    assert policy.precharge.continuous.max_min == 20
    assert _amperes(policy, policy.current.temperature_c) == [(0, 10, 2.0), (10, 15, 6.0), (15, 45, 14.0)]
    assert _amperes(policy, policy.current.soc_pct) == [(0, 90, 14.0), (90, 100, 8.0)]
    assert _amperes(policy, policy.current.soh_pct) == [(60, 80, 11.0), (80, 100, 14.0)]
    assert policy.finish.target_soc_pct == 100
    assert policy.finish.full.soc_pct is None, "a BMU that reads too much would end every charge early"
    assert policy.finish.full.charger
    assert policy.finish.full.taper is not None
    assert max_hours(policy, (2.0, 5.0, 8.0, 11.0, 14.0)) == 30
    assert policy.recharge.soc_below_pct == 95


def _amperes(policy: Policy, table: Table | None) -> list[tuple[float, float, float]]:
    assert table is not None
    pack = policy.pack
    return [(row.from_, row.to, row_a(row, pack.current_a, pack.capacity_ah)) for row in table.rows]


def test_long_life_stops_at_80_percent_and_goes_all_the_way_every_other_week() -> None:
    finish = load_policy("long-life-48v").finish
    assert (finish.target_soc_pct, finish.full_every_days) == (80, 14)


def test_lfp_is_held_at_the_top_and_its_soc_ends_no_charge() -> None:
    finish = load_policy("lfp-48v").finish
    assert (finish.hold_min, finish.full.soc_pct) == (30, None)


def test_one_policy_shows_every_key() -> None:
    """Where keys are explained, none is left out, be it in a comment."""
    text = (shipped_dir() / "policies/li-ion-48v.yaml").read_text(encoding="utf-8")
    for record in (Policy, Pack, Start, Recharge, PrechargeRule, Table, Where, Finish, Full, Taper, Thresholds):
        for name in slots(record):
            assert re.search(rf"\b{name}\b", text), name


def _bits(object_map: ObjectMap) -> dict[str, tuple[int, int, int]]:
    return {
        field.name: (entry.index, field.first_bit, field.width)
        for entry in object_map.objects
        for field in entry.fields
    }


def test_tabos_has_the_first_named_value_on_top() -> None:
    assert _bits(load_map("tabos")) == {
        "voltage_v": (0x6000, 16, 16),
        "current_a": (0x6000, 0, 16),
        "status": (0x6001, 16, 16),
        "time_to_full_min": (0x6001, 0, 16),
        "time_to_empty_min": (0x6002, 16, 16),
        "soc_pct": (0x6002, 8, 8),
        "soh_pct": (0x6002, 0, 8),
        "remaining_ah": (0x6003, 16, 16),
        "available_wh": (0x6003, 0, 16),
        "temperature_c": (0x6004, 0, 16),
    }


def test_tabos_lsb_has_it_at_the_bottom_except_in_the_documented_sample() -> None:
    assert _bits(load_map("tabos-lsb")) == {
        "voltage_v": (0x6000, 16, 16),
        "current_a": (0x6000, 0, 16),
        "status": (0x6001, 0, 16),
        "time_to_full_min": (0x6001, 16, 16),
        "time_to_empty_min": (0x6002, 0, 16),
        "soc_pct": (0x6002, 16, 8),
        "soh_pct": (0x6002, 24, 8),
        "remaining_ah": (0x6003, 0, 16),
        "available_wh": (0x6003, 16, 16),
        "temperature_c": (0x6004, 0, 16),
    }


@pytest.mark.parametrize("name", MAPS)
def test_a_map_claims_no_more_than_is_known(name: str) -> None:
    claims = {field.name: field.evidence for entry in load_map(name).objects for field in entry.fields}
    inferred = {field for field, evidence in claims.items() if evidence is Evidence.INFERRED}
    assert inferred == {"voltage_v", "current_a"}
    assert set(claims.values()) == {Evidence.INFERRED, Evidence.ASSUMED}


@pytest.mark.parametrize("name", MAPS)
def test_a_map_knows_what_the_tpdos_are_assumed_to_carry(name: str) -> None:
    tpdos = {tpdo.number: tpdo.objects for tpdo in load_map(name).tpdos}
    assert tpdos == {1: (0x6000, 0x6001), 2: (0x6002, 0x6003), 3: (0x6004,)}


@pytest.mark.parametrize("name", STATIONS)
def test_a_station_names_shipped_policies_and_maps(name: str) -> None:
    station = load_station(shipped_dir() / "configs/stations" / f"{name}.yaml")
    for bay in station.bays:
        assert bay.policy.policy in POLICIES
        assert bay.battery.map.map in MAPS
        assert bay.charger.control is ControlMode.MANUAL
