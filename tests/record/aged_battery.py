"""A battery whose ageing is known, with the devices that it is charged and seen by, drawn at random.

The devices are as their documents have them: volts in 10 mV, current in 10 mA, temperature in 0.1 °C, SOC in whole per
cent, rounded or cut off. The documents state no accuracy; what is drawn here is ordinary for such devices: currents
within 1 % and 20 mA, volts within 0.5 %, a thermometer within 1 K (each in 95 devices of 100), a SOC whose scale is
within 1 % and that drifts between charges.
"""

import math
from dataclasses import dataclass
from random import Random

YEAR_S = 365.25 * 86_400.0
#: Only the last charges of a life are made: more than the product looks at.
MOST = 80


@dataclass(frozen=True, slots=True)
class Ageing:
    """How a quantity changes over years: as their root, linearly, and faster after a knee."""

    by_root: float
    by_year: float
    knee_years: float
    by_knee: float

    def after(self, years: float) -> float:
        """The change, as a share."""
        late = max(years - self.knee_years, 0.0)
        return self.by_root * math.sqrt(years) + self.by_year * years + self.by_knee * late


class Life:
    """One battery, its BMU and its charger."""

    def __init__(self, seed: int, worse: float = 1.0) -> None:
        dice = self.dice = Random(seed)
        self.years = dice.uniform(0.1, 5.0)
        self.rated_ah = dice.choice((10.0, 20.0, 20.0, 40.0))
        self.made_ah = self.rated_ah * dice.gauss(1.0, 0.02)
        self.cells = dice.choice((7, 13, 13, 16))
        self.new_ohm = dice.uniform(0.03, 0.12)
        knee = dice.uniform(0.5, 5.0) if dice.random() < 0.2 else 99.0
        self.fade = Ageing(dice.uniform(0.005, 0.03), dice.uniform(0.005, 0.04), knee, dice.uniform(0.02, 0.08))
        self.growth = Ageing(dice.uniform(0.0, 0.06), dice.uniform(0.01, 0.12), knee, dice.uniform(0.05, 0.2))
        self.activation_k = dice.uniform(1500.0, 3500.0)
        self.slow_share, self.slow_s = dice.uniform(0.1, 0.5), dice.uniform(30.0, 120.0)
        # the devices
        self.charger_gain, self.bmu_gain = (1 + worse * dice.gauss(0.0, 0.005) for _ in range(2))
        self.charger_zero_a, self.bmu_zero_a = (dice.uniform(-0.02, 0.02) for _ in range(2))
        self.volts_gain, self.off_k = 1 + worse * dice.gauss(0.0, 0.0025), worse * dice.gauss(0.0, 0.5)
        self.soc_scale, self.drift_pct = worse * dice.gauss(0.0, 0.005), dice.uniform(0.3, 1.5)
        self.cuts_off = dice.random() < 0.5
        self.stale_soh = dice.random() < 0.5  # a BMU that never learns
        # how it is used
        self.hall_c, self.season_k = dice.uniform(14.0, 30.0), dice.uniform(0.0, 9.0)
        self.every_s = 86_400.0 * dice.choice((0.5, 1.0, 1.0, 3.0, 7.0))
        self.deepest_pct = dice.uniform(5.0, 60.0)
        self.target_pct = dice.choice((80.0, 100.0, 100.0))
        self.count = min(MOST, dice.choice((5, 12, 30, 80, 80)), int(self.years * YEAR_S / self.every_s))

    def capacity_ah(self, years: float) -> float:
        """What it holds at this age, at 25 °C."""
        return self.made_ah * (1 - self.fade.after(years))

    def ohm(self, years: float, pack_c: float = 25.0, soc_pct: float = 50.0) -> float:
        """Its resistance at this age."""
        colder = 1 / (pack_c + 273.15) - 1 / 298.15
        emptier = 1 + 0.3 * math.exp(-soc_pct / 8)
        return self.new_ohm * (1 + self.growth.after(years)) * math.exp(self.activation_k * colder) * emptier
