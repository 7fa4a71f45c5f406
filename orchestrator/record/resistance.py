"""A battery's resistance at 25 °C, from the changes of its current. Pure.

Each charge gives one figure: how far the volts rose divided by how far the current did, over all its changes between
20 and 90 % SOC, the large ones counting more (least squares through the origin). A cold pack has a multiple of the
resistance of a warm one, so the figures are brought to 25 °C by Arrhenius' law. How steep that is differs by cell: the
charges show it as far as their temperatures differ; otherwise it is `STEEPNESS`, and the interval is wide for a
battery that was only ever charged in the cold.

The interval holds the scatter between charges, that steepness, age (as for the capacity), and what all charges have in
common: the BMU's current ± 1 % and volts ± 0.5 %, its thermometer ± 1 K, and ± 2 % for what the cells' slow voltage
adds in the seconds between the two readings.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.record.capacity import Estimate, around
from orchestrator.record.change import LEAST_A, Change
from orchestrator.record.fit import Row, fitted, within

#: Fewer charges cannot tell a value, a steepness and a scatter.
LEAST = 4
#: Beyond these a resistance is another one: nearly empty, nearly full, frost, heat.
SOC_PCT, PACK_C = (20.0, 90.0), (5.0, 45.0)
#: No pack has less.
LEAST_OHM = 1e-6
#: 25 °C and absolute zero.
REFERENCE_C, ZERO_C = 25.0, -273.15
#: What is known beforehand of growing (share a year) and of the law's steepness (K), and their deviations.
GROWTH, STEEPNESS = (0.0, 0.15), (2500.0, 1000.0)
#: The resolution of the volts, V, and the share by which charges differ otherwise; the scatter tells how much it is.
RESOLUTION_V, SPREAD, LEAST_RATIO = 0.01, 0.02, 0.2
#: The errors that all charges share, as shares and in K.
CURRENT, VOLTS, SLOW, THERMOMETER_K = 0.01, 0.005, 0.02, 1.0


@dataclass(frozen=True, slots=True)
class Resistance:
    """In mΩ at 25 °C, with the changes of the current behind it and the temperatures at which they were."""

    mohm: Estimate
    changes: int
    lowest_c: float
    highest_c: float


@dataclass(frozen=True, slots=True)
class Steps:
    """The usable changes of the current of one charge, and how many years before the newest charge it was."""

    changes: tuple[Change, ...]
    years: float

    @property
    def ohm(self) -> float:
        """At the temperature at which they were."""
        return sum(one.rise_v * one.rise_a for one in self.changes) / self.square_a

    @property
    def square_a(self) -> float:
        """How much they say: the sum of the squares of their amperes."""
        return sum(one.rise_a**2 for one in self.changes)

    @property
    def colder(self) -> float:
        """What the law's steepness is multiplied with: 1/T − 1/298 K, as a mean."""
        celsius = sum(one.temperature_c * one.rise_a**2 for one in self.changes) / self.square_a
        return 1 / (celsius - ZERO_C) - 1 / (REFERENCE_C - ZERO_C)


def usable(changes: Sequence[Change]) -> tuple[Change, ...]:
    """Those that tell a resistance."""
    (low_pct, high_pct), (low_c, high_c) = SOC_PCT, PACK_C
    return tuple(
        one
        for one in changes
        if low_pct <= one.soc_pct <= high_pct and low_c <= one.temperature_c <= high_c and abs(one.rise_a) >= LEAST_A
    )


def resistance(found: Sequence[Steps]) -> Resistance | None:
    """The resistance at the newest of these charges; None if too few of them have a usable change."""
    told = [one for one in found if one.changes and one.ohm > LEAST_OHM]
    if len(told) < LEAST:
        return None
    rows = [Row(math.log(one.ohm), _expected(one), (-one.years, one.colder)) for one in told]
    fit = fitted(rows, (GROWTH, STEEPNESS), LEAST_RATIO)
    if fit is None:
        return None
    by_kelvin = STEEPNESS[0] / (REFERENCE_C - ZERO_C) ** 2
    common = within(CURRENT, VOLTS, SLOW, THERMOMETER_K * by_kelvin)
    mohm = around(fit, common, len(told), unit=1000.0)
    all_c = [change.temperature_c for one in told for change in one.changes]
    return Resistance(mohm, len(all_c), min(all_c), max(all_c))


def _expected(one: Steps) -> float:
    """The uncertainty of its logarithm; both volts of a change are rounded."""
    rounded = RESOLUTION_V / math.sqrt(6 * one.square_a) / one.ohm
    return math.hypot(rounded, SPREAD)
