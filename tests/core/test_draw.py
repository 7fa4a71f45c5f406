"""What each charger may draw, and how the supplies of a station file become those that are divided."""

from dataclasses import replace
from pathlib import Path

from orchestrator.config.load import load_station
from orchestrator.config.station import SupplyConfig
from orchestrator.core.draw import draw_w, supplies_of
from orchestrator.core.supply import Supply
from orchestrator.model import ControlMode

STATION = load_station(Path(__file__).parents[1] / "config" / "good" / "station-supplies.yaml")


def test_a_draw_is_stated_or_computed_from_what_the_over_current_fault_lets_pass() -> None:
    computed, stated, efficient = map(draw_w, STATION.bays)
    # 55.2 V × (2 A × 110 % + 0.3 A) / 0.8 + 30 W = 202.5 W
    assert computed == (30, 203, 431, 658, 886, 1114)
    assert stated == (12, 150, 330, 520, 700, 890)
    assert efficient[5] == 993  # 55.2 V × 15.7 A / 0.9 + 30 W = 992.9 W


def test_a_tolerance_counts_and_a_charger_with_its_own_program_has_one_level() -> None:
    bay = STATION.bays[0]
    assert draw_w(replace(bay, charger=replace(bay.charger, tolerance_pct=10.0)))[5] == 1220
    assert draw_w(replace(bay, charger=replace(bay.charger, control=ControlMode.AUTOMATIC))) == (30, 1114)


def test_a_bay_is_on_the_innermost_supply_that_names_it() -> None:
    supplies, outside = supplies_of(STATION)
    assert supplies.supplies[0] == Supply("hall", 3000, None, STATION.source.at("supplies.hall.limit_w"))
    assert [load.supply for load in supplies.loads] == ["hall", "rack.2", "hall"]
    assert supplies.paths == ((0,), (1, 0), (0,))
    assert outside == ()


def test_limits_are_rounded_down_and_bays_may_be_in_none() -> None:
    some = {"hall": SupplyConfig(limit_w=999.9, bays=("bay-2",))}
    supplies, outside = supplies_of(replace(STATION, supplies=some))
    assert supplies.limits_w == (999,)
    assert outside == ("bay-1", "bay-3")
    assert supplies_of(replace(STATION, supplies=None))[1] == ("bay-1", "bay-2", "bay-3")
