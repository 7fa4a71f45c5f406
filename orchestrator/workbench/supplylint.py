"""Lints a station's supplies: feeds too small for any step, bays on none, and feeds that share more than there is."""

from collections.abc import Iterator, Mapping

from orchestrator.config.rules import Problems
from orchestrator.config.station import BayConfig, SupplyConfig
from orchestrator.core.draw import draw_w
from orchestrator.keys import Source


def supply_lint(values: Mapping[str, object], _written: Source) -> Problems:
    """Warnings about the supplies, by the paths of their keys."""
    supplies, bays = values.get("supplies"), values.get("bays")
    if not isinstance(supplies, Mapping) or not isinstance(bays, tuple):
        return
    members = {name: _members(supplies, name) for name in supplies}
    for name, supply in supplies.items():
        yield from _too_small(name, supply, [bay for bay in bays if bay.name in members[name]])
        yield from _shared(name, supply, {other: one for other, one in supplies.items() if one.within == name})
    outside = [bay.name for bay in bays if not any(bay.name in names for names in members.values())]
    if outside:
        yield "supplies", f"in no supply: {', '.join(outside)}; nothing limits or counts what is drawn there"


def _members(supplies: Mapping[str, SupplyConfig], name: str) -> set[str]:
    """The bays on this supply and on all within it."""
    return set(supplies[name].bays).union(
        *(_members(supplies, one) for one in supplies if supplies[one].within == name)
    )


def _too_small(name: str, supply: SupplyConfig, bays: list[BayConfig]) -> Iterator[tuple[str, str]]:
    if not bays:
        yield f"supplies.{name}.bays", "no bay is on it, and none on a supply within it"
        return
    draws = [draw_w(bay) for bay in bays]
    idle_w = sum(watts[0] for watts in draws)
    least_w = idle_w + min(watts[1] - watts[0] for watts in draws)
    if supply.limit_w < least_w:
        yield (
            f"supplies.{name}.limit_w",
            f"no charge ever begins: the lowest step of one bay, the others in standby, may draw {least_w:,} W "
            "(draw_w states what was measured; else it is computed from steps_a, efficiency and idle_w)",
        )


def _shared(name: str, supply: SupplyConfig, within: Mapping[str, SupplyConfig]) -> Iterator[tuple[str, str]]:
    sum_w = sum(one.limit_w for one in within.values())
    if sum_w > supply.limit_w:
        yield (
            f"supplies.{name}.limit_w",
            f"{', '.join(within)} may draw {sum_w:,.0f} W together, more than the {supply.limit_w:,.0f} W here: "
            "they share these",
        )
