"""A lithium cell's voltage over its charge: the curves of two chemistries, and their BMU's alarm thresholds."""

import math
from bisect import bisect_right
from dataclasses import dataclass

Curve = tuple[tuple[float, float], ...]


def interpolate(curve: Curve, x: float) -> float:
    """The curve's value at x: linear between points, constant beyond the ends; the points' x must ascend."""
    upper = bisect_right(curve, (x, math.inf))
    if upper == 0:
        return curve[0][1]
    if upper == len(curve):
        return curve[-1][1]
    (x0, y0), (x1, y1) = curve[upper - 1], curve[upper]
    return y0 + (y1 - y0) * (x - x0) / (x1 - x0)


@dataclass(frozen=True, slots=True)
class Chemistry:
    """One kind of cell: open-circuit voltage, and its BMU's alarm thresholds (wider than any charge policy)."""

    ocv: Curve  #: over the state of charge (0 … 1); beyond 1 the cell is overcharged
    deep: Curve  #: below 0 %, over the share of the deep discharge (−1 … 0): steep at first, then flatter
    high_cell_v: float  #: the BMU reports over-voltage above this
    low_cell_v: float  #: … and low voltage below this


#: Typical of nickel-manganese-cobalt and nickel-cobalt-aluminium cells.
NMC = Chemistry(
    ocv=(
        (0.00, 3.00),
        (0.05, 3.35),
        (0.10, 3.45),
        (0.20, 3.55),
        (0.30, 3.60),
        (0.40, 3.65),
        (0.50, 3.70),
        (0.60, 3.78),
        (0.70, 3.88),
        (0.80, 3.98),
        (0.90, 4.08),
        (1.00, 4.19),
        (1.05, 4.45),
    ),
    deep=((-2.0, 0.0), (-1.0, 2.54), (-0.57, 2.76), (0.0, 3.00)),
    high_cell_v=4.25,
    low_cell_v=2.80,
)

#: Typical of lithium iron phosphate: flat in the middle, steep at both ends.
LFP = Chemistry(
    ocv=(
        (0.00, 2.50),
        (0.02, 2.90),
        (0.05, 3.10),
        (0.10, 3.20),
        (0.20, 3.25),
        (0.30, 3.28),
        (0.40, 3.29),
        (0.60, 3.30),
        (0.70, 3.32),
        (0.80, 3.33),
        (0.95, 3.34),
        (0.98, 3.38),
        (1.00, 3.45),
        (1.03, 3.80),
    ),
    deep=((-2.0, 0.0), (-1.0, 2.10), (-0.50, 2.30), (0.0, 2.50)),
    high_cell_v=3.75,
    low_cell_v=2.30,
)
