"""What a cell's voltage says about its state of charge, and the reverse: enough to tell packs apart.

Open-circuit voltages of a cell by chemistry, as in data sheets and text books. The bounds around them are wide: a gauge
may be off by `SOC_ERROR_PCT`, a cell under load or just after it by `BELOW_V`, under charge by the chemistry's own
overvoltage. A value outside means another battery, or a SOC that is plainly wrong.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from orchestrator.config.policy import CellType, Pack

#: An uncalibrated gauge may be wrong by this much.
SOC_ERROR_PCT = 20.0
#: At or below this, a deeply discharged pack may have any low voltage.
EMPTY_PCT = 20.0
#: After a load a cell is below its open-circuit voltage by up to this.
BELOW_V = 0.10


@dataclass(frozen=True, slots=True)
class Chemistry:
    """Open-circuit volts of one cell at rising states of charge (%), and how far charging may raise them."""

    name: str
    curve: tuple[tuple[float, float], ...]
    above_v: float

    def ocv_v(self, soc_pct: float) -> float:
        """Linear between two points of the curve, constant beyond its ends."""
        last_pct, last_v = self.curve[0]
        if soc_pct <= last_pct:
            return last_v
        for pct, volts in self.curve:
            if soc_pct <= pct:
                return last_v + (volts - last_v) * (soc_pct - last_pct) / (pct - last_pct)
            last_pct, last_v = pct, volts
        return last_v

    def bounds_v(self, soc_pct: float) -> tuple[float, float]:
        """The lowest and highest volts of a cell of this chemistry at this state of charge."""
        low = -inf if soc_pct <= EMPTY_PCT else self.ocv_v(soc_pct - SOC_ERROR_PCT) - BELOW_V
        return low, self.ocv_v(soc_pct + SOC_ERROR_PCT) + self.above_v


NMC = Chemistry(
    "NMC/NCA",
    ((0, 3.00), (5, 3.35), (10, 3.45), (20, 3.55), (30, 3.60), (40, 3.63), (50, 3.67), (60, 3.75), (70, 3.85),
     (80, 3.95), (90, 4.06), (100, 4.18)),
    0.15,
)  # fmt: skip
LFP = Chemistry("LFP", ((0, 2.80), (5, 3.00), (10, 3.15), (20, 3.22), (50, 3.29), (90, 3.33), (100, 3.45)), 0.30)
LTO = Chemistry("LTO", ((0, 1.80), (10, 2.10), (50, 2.25), (90, 2.45), (100, 2.70)), 0.20)
#: NMC and NCA cannot be told apart by their volts.
CHEMISTRIES: Mapping[CellType, Chemistry] = {CellType.NMC: NMC, CellType.NCA: NMC, CellType.LFP: LFP, CellType.LTO: LTO}


def chemistry(pack: Pack) -> Chemistry:
    """The chemistry that a policy's pack must have."""
    return CHEMISTRIES[pack.chemistry]
