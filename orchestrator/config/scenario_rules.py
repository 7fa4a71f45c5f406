"""Rules between the keys of one scenario."""

from collections.abc import Mapping
from itertools import pairwise

from orchestrator.config.names import name_problem
from orchestrator.config.rules import Problems, Rule
from orchestrator.config.scenario import Ask, BatteryModel, Defect, SensorFault, Visit, Weather
from orchestrator.config.station_rules import lowest_step_problems, step_problems
from orchestrator.config.yaml.scalars import did_you_mean

Visits = tuple[Visit, ...]


def _name(name: str) -> Problems:
    if problem := name_problem(name):
        yield "scenario", problem


def _weather(weather: tuple[Weather, ...]) -> Problems:
    if weather[0].at_h != 0:
        yield "weather[0].at_h", f"the weather begins at 0 h, not at {weather[0].at_h:g} h"
    for i, (before, row) in enumerate(pairwise(weather), start=1):
        if row.at_h <= before.at_h:
            yield f"weather[{i}].at_h", f"{row.at_h:g} h is not after the row above, {before.at_h:g} h"


def _stays(visits: Visits, hours: float) -> Problems:
    """Visits must follow one another, all within the scenario."""
    for i, visit in enumerate(visits):
        if visit.from_h >= hours:
            yield f"visits[{i}].from_h", f"{visit.from_h:g} h is after the end, `hours` is {hours:g}"
        if visit.to_h is not None and visit.to_h <= visit.from_h:
            yield f"visits[{i}].to_h", f"it leaves at {visit.to_h:g} h, before it arrives at {visit.from_h:g} h"
    for i, (before, visit) in enumerate(pairwise(visits), start=1):
        if before.to_h is None:
            yield f"visits[{i - 1}].to_h", "say when it leaves: another one comes after it"
        elif visit.from_h < before.to_h:
            yield f"visits[{i}].from_h", f"at {visit.from_h:g} h the bay is taken until {before.to_h:g} h"


def _arrivals(visits: Visits, batteries: Mapping[str, BatteryModel]) -> Problems:
    """Every battery must be known, and so must its charge."""
    been_here: set[str] = set()
    for i, visit in enumerate(visits):
        if visit.battery not in batteries:
            yield f"visits[{i}].battery", f"no battery has this name; {did_you_mean(visit.battery, batteries)}"
        elif (visit.soc_pct is None) == (visit.used_pct is None):
            yield f"visits[{i}]", "write either soc_pct or used_pct: how full is it when it arrives?"
        elif visit.used_pct is not None and visit.battery not in been_here:
            yield f"visits[{i}].used_pct", f"{visit.battery} is here for the first time: write soc_pct"
        been_here.add(visit.battery)


def _sensors(sensors: tuple[SensorFault, ...]) -> Problems:
    for i, fault in enumerate(sensors):
        if fault.to_h is not None and fault.to_h <= fault.from_h:
            yield f"sensors[{i}].to_h", f"it ends at {fault.to_h:g} h, before it begins at {fault.from_h:g} h"
        if (fault.defect in (Defect.OFFSET, Defect.DRIFT)) is not (fault.by != 0):
            yield f"sensors[{i}].by", "offset and drift need it, other than 0; stuck and silent do not have it"


def _operator(asks: tuple[Ask, ...]) -> Problems:
    for i, (before, ask) in enumerate(pairwise(asks), start=1):
        if ask.at_h <= before.at_h:
            yield f"operator[{i}].at_h", f"{ask.at_h:g} h is not after the row above, {before.at_h:g} h"


SCENARIO_RULES: tuple[Rule, ...] = (
    Rule(_name, ("scenario",)),
    Rule(_weather, ("weather",)),
    Rule(step_problems, ("charger.steps_a",)),
    Rule(lowest_step_problems, ("charger.steps_a", "limits.current_a")),
    Rule(_stays, ("visits", "hours")),
    Rule(_arrivals, ("visits", "batteries")),
    Rule(_sensors, ("sensors",)),
    Rule(_operator, ("operator",)),
)
