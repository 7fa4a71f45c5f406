"""Finds the CAN buses that are too slow for the BMUs that a station file puts on them."""

from collections.abc import Iterator

from orchestrator.config.station import Station
from orchestrator.devices.battery import ANSWER_LIMIT_S
from orchestrator.devices.bus_budget import SHARE, BusBudget
from orchestrator.devices.read_plan import ReadPlan

#: A value read this rarely is stale after one lost answer.
SLOW_S = ANSWER_LIMIT_S / 2


def slow_buses(station: Station) -> Iterator[str]:
    """A warning, with its line, for each bus on which voltage, current and status are read too rarely."""
    for name, settings in station.can.items():
        bitrate = settings.get("bitrate")
        nodes = [bay.battery for bay in station.bays if bay.battery.can == name]
        if not isinstance(bitrate, int) or not nodes:
            continue
        budget = BusBudget(bitrate)
        plans = [ReadPlan(node, budget) for node in nodes]
        period_s = max(plan.fast_s for plan in plans)
        if period_s > SLOW_S:
            yield (
                f"{station.source.at(f'can.{name}')}: warning: {len(nodes)} BMUs on {bitrate / 1000:g} kbit/s: with "
                f"{SHARE:.0%} of the bus each fast value comes every {period_s:.2f} s and is stale after "
                f"{ANSWER_LIMIT_S:g} s; one lost answer may stop a charge: use a higher bit rate, or more buses"
            )
