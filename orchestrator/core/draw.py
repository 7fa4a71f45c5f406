"""A station file's supplies as `allocate()` divides them: whole watts, and each bay's worst case on every level."""

from collections.abc import Mapping
from math import ceil, floor

from orchestrator.config.amperes import DIGITS
from orchestrator.config.policy import Thresholds
from orchestrator.config.station import BayConfig, Station, SupplyConfig
from orchestrator.core.rules import OVER_CURRENT_OFFSET_A
from orchestrator.core.supply import Load, Supplies, Supply
from orchestrator.model import ControlMode

#: Of each threshold the loosest value that a policy may have.
LOOSEST = Thresholds()


def draw_w(bay: BayConfig) -> tuple[int, ...]:
    """What the bay's charger may draw in standby and on each level.

    What no policy's over-current fault need stop yet may flow, at the highest voltage that the station permits: another
    policy can come into force at any time. A charger that follows its own program has one level, its highest step.
    """
    charger = bay.charger
    stated = charger.draw_w if charger.draw_w is not None else tuple(_computed_w(bay, amps) for amps in charger.steps_a)
    steps = [ceil(round(watts, DIGITS)) for watts in stated]
    return (ceil(charger.idle_w), *(steps if charger.control is ControlMode.MANUAL else steps[-1:]))


def _computed_w(bay: BayConfig, step_a: float) -> float:
    charger = bay.charger
    worst_a = step_a * (1 + charger.tolerance_pct / 100) * LOOSEST.over_current_pct / 100
    return bay.limits.voltage_v * (worst_a + OVER_CURRENT_OFFSET_A) / charger.efficiency + charger.idle_w


def supplies_of(station: Station) -> tuple[Supplies, tuple[str, ...]]:
    """The station's supplies, and the bays in none of them."""
    supplies = station.supplies or {}
    on = _supply_of(supplies)
    tree = [
        Supply(name, floor(one.limit_w), one.within, station.source.at(f"supplies.{name}.limit_w"))
        for name, one in supplies.items()
    ]
    loads = [Load(bay.name, on[bay.name], draw_w(bay)) for bay in station.bays if bay.name in on]
    return Supplies.of(tree, loads), tuple(bay.name for bay in station.bays if bay.name not in on)


def _supply_of(supplies: Mapping[str, SupplyConfig]) -> dict[str, str]:
    """The supply that each bay is directly on: of several that name it, the one within all others."""
    on: dict[str, str] = {}
    for name in sorted(supplies, key=lambda name: _depth(supplies, name)):
        on.update(dict.fromkeys(supplies[name].bays, name))
    return on


def _depth(supplies: Mapping[str, SupplyConfig], name: str) -> int:
    within = supplies[name].within
    return 0 if within is None else 1 + _depth(supplies, within)
