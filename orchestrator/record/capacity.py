"""A battery's capacity, from what flowed while its SOC rose. Pure.

Each charge gives one figure: the Ah of its longest stretch without a jump of the SOC, divided by what part of 100 %
the SOC rose in it. The Ah are the mean of two witnesses, charger and BMU. A stretch of less than 30 %, or outside 15 …
35 °C, gives none.

The interval holds three things. *The scatter between charges*, which is mostly the BMU's SOC: the charges themselves
show it, weighted by how far the SOC rose, since an error of the SOC costs a long stretch less. *Age*: the value is
that of a straight line through the last charges at the newest of them, so the past does not flatter a battery that
fades; its slope comes from the charges, and from `FADE` where they are few. *What all charges have in common*, which
no scatter shows: the two current sensors and the scale of the SOC, each within ± 1 % in 95 devices of 100, and ± 0.5 %
for the temperature.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.record.fit import Fit, Row, fitted, half_width, within
from orchestrator.record.stretch import Stretch

#: A shorter stretch, or one at other temperatures, says too little.
LEAST_RISE_PCT, LOWEST_C, HIGHEST_C = 30.0, 15.0, 35.0
#: Less has not flowed.
LEAST_AH = 0.001
#: Fewer charges give no scatter to go by.
LEAST = 3
#: An error of the SOC's rise by which the charges are weighted; how large it really is, their scatter tells.
SOC_ERROR_PCT, LEAST_RATIO = 1.0, 0.1
#: What is known of fading beforehand: share a year, and its deviation.
FADE = (0.0, 0.08)
#: The errors that all charges share, as shares: a current sensor, the scale of the SOC, the temperature.
SENSOR, SCALE, WARMTH = 0.01, 0.01, 0.005
#: Charger and BMU that part by more in one charge: one of them missed a part of it.
APART = 0.1


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value, its 95 % interval and the number of charges behind it."""

    value: float
    low: float
    high: float
    charges: int

    def of(self, whole: float) -> "Estimate":
        """The same as per cent of `whole`."""
        value, low, high = (100 * part / whole for part in (self.value, self.low, self.high))
        return Estimate(value, low, high, self.charges)


@dataclass(frozen=True, slots=True)
class Aged:
    """One stretch, and how many years before the newest charge it was."""

    stretch: Stretch
    years: float


def is_usable(stretch: Stretch | None) -> bool:
    """Whether a stretch tells a capacity."""
    if stretch is None or stretch.rise_pct < LEAST_RISE_PCT or stretch.charger_ah < LEAST_AH:
        return False
    if stretch.lowest_c < LOWEST_C or stretch.highest_c > HIGHEST_C:
        return False
    return not _is_counted(stretch) or abs(_apart(stretch)) <= APART


def capacity(found: Sequence[Aged]) -> Estimate | None:
    """The capacity in Ah at the newest of these usable stretches; None if they are too few."""
    if len(found) < LEAST:
        return None
    rows = [
        Row(
            math.log(_ah(one.stretch) / one.stretch.rise_pct * 100), SOC_ERROR_PCT / one.stretch.rise_pct, (-one.years,)
        )
        for one in found
    ]
    fit = fitted(rows, (FADE,), LEAST_RATIO)
    if fit is None:
        return None
    return around(fit, _common([one.stretch for one in found]), len(found))


def around(fit: Fit, common: float, charges: int, unit: float = 1.0) -> Estimate:
    """The estimate whose logarithm was fitted; `common` is the standard uncertainty that all charges share."""
    half = half_width(fit, common)
    value, low, high = (unit * math.exp(fit.value + one) for one in (0.0, -half, half))
    return Estimate(value, low, high, charges)


def balance(found: Sequence[Stretch]) -> float | None:
    """What the BMU counted, as a share of what the charger delivered; None if it counts nothing."""
    both = [one for one in found if _is_counted(one)]
    return sum(one.bmu_ah for one in both) / sum(one.charger_ah for one in both) if both else None


def _is_counted(stretch: Stretch) -> bool:
    """Whether the BMU has a current at all."""
    return stretch.bmu_ah >= LEAST_AH


def _ah(stretch: Stretch) -> float:
    return math.sqrt(stretch.charger_ah * stretch.bmu_ah) if _is_counted(stretch) else stretch.charger_ah


def _apart(stretch: Stretch) -> float:
    return math.log(stretch.bmu_ah / stretch.charger_ah)


def _common(found: Sequence[Stretch]) -> float:
    """What all charges share; if the two witnesses part by more than both may err, the interval reaches to either."""
    share = balance(found)
    if share is None:
        return within(SENSOR, SCALE, WARMTH)
    apart = abs(math.log(share))
    current = apart / 2 if apart > 2 * SENSOR else within(SENSOR / 2, SENSOR / 2)
    return math.hypot(current, within(SCALE, WARMTH))
