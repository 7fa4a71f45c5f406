"""The status in one line: how many bays do what, the amperes and kilowatts that flow, and the time."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import cast

from orchestrator.model import Cause
from orchestrator.show import Bay, level_of

#: A bay that needs a person counts as that alone, whatever its state.
NEEDS = "count_needs"
#: Each state by what people care about, in the order of the line.
COUNTED = {
    "CHARGING": "count_charging",
    "PRECHARGE_PULSE": "count_charging",
    "PRECHARGE_CONTINUOUS": "count_charging",
    NEEDS: NEEDS,
    "FULL": "count_full",
    "QUALIFYING": "count_checking",
    "SUSPENDED": "count_suspended",
    "HELD": "count_held",
    "TRIPPED": "count_held",
    "STARTING": "count_stopping",
    "STOPPING": "count_stopping",
    "OFFLINE": "count_offline",
    "IDLE": "count_idle",
}
#: A state that only a newer service knows.
OTHER = "count_other"
ORDER = (*dict.fromkeys(COUNTED.values()), OTHER)
#: Counts that read differently for one.
SINGULAR = {"count_bays": "count_bay", NEEDS: "count_need"}
#: A sum from here on is shown without decimals.
COARSE = 10.0


def gist(bays: Sequence[Bay], clock: str) -> Cause:
    """The head line of these bays; `clock` is the time of day."""
    counts = Counter(COUNTED.get(NEEDS if level_of(bay) else str(bay["state"]), OTHER) for bay in bays)
    told = tuple(counted(id_, counts[id_]) for id_ in ORDER if counts[id_])
    return Cause.of("gist", bays=counted("count_bays", len(bays)), counts=told, flow=_flow(bays), clock=clock)


def counted(id_: str, number: int) -> Cause:
    """So many of these."""
    return Cause.of(SINGULAR.get(id_, id_) if number == 1 else id_, number=number)


def _flow(bays: Sequence[Bay]) -> Cause | None:
    """What the chargers deliver together, by readings that are present and not old; None if there are none."""
    flows = list(_flows(bays))
    if not flows:
        return None
    kilowatts = sum(amps * volts for amps, volts in flows) / 1000
    return Cause.of("gist_flow", amps=_rounded(sum(amps for amps, _ in flows)), kilowatts=_rounded(kilowatts))


def _flows(bays: Sequence[Bay]) -> Iterator[tuple[float, float]]:
    """The amperes and volts of each charger."""
    for charger in (cast("Mapping[str, object]", bay["charger"]) for bay in bays):
        amps, volts = charger.get("current_a"), charger.get("voltage_v")
        if isinstance(amps, int | float) and isinstance(volts, int | float) and not charger.get("old"):
            yield amps, volts


def _rounded(value: float) -> str:
    return f"{value:.0f}" if value >= COARSE or not value else f"{value:.1f}"
