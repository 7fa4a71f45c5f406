"""Scenarios for the tests of the workbench: shipped ones, cut to what a test needs."""

from dataclasses import replace
from typing import Any

from orchestrator.config.load import load_scenario
from orchestrator.config.scenario import BatteryModel, Cell, Scenario, Visit, Weather


def battery(**changes: Any) -> BatteryModel:
    """A small 13S pack, full in about half an hour."""
    values: dict[str, Any] = {
        "cells": Cell.NMC, "cells_in_series": 13, "capacity_ah": 8.0, "resistance_ohm": 0.05, "arrhenius_k": 2200.0,
        "polarisation_ohm": 0.03, "heat_j_per_k": 6000.0, "cooling_w_per_k": 2.0,
    }  # fmt: skip
    return BatteryModel(**{**values, **changes})


def scenario(hours: float = 1.0, **changes: Any) -> Scenario:
    """One battery of 30 % in the bay at 20 °C."""
    shipped = load_scenario("cold-morning")
    values: dict[str, Any] = {
        "scenario": "test", "hours": hours, "weather": (Weather(at_h=0, ambient_c=20),),
        "batteries": {"pack-1": battery()}, "visits": (Visit(battery="pack-1", from_h=0, soc_pct=30),),
    }  # fmt: skip
    return replace(shipped, **{**values, **changes})
