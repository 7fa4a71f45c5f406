"""A model of a lithium battery pack: charge, open-circuit voltage, resistance, heat. Pure: time is an argument.

It is a Thevenin equivalent circuit: a voltage source (the open-circuit voltage over the charge), a series resistance
and, if `polarisation_ohm` is given, one RC pair, which makes the voltage fall for another minute after the current has
stopped. The heat warms a single thermal mass, which cools towards its surroundings.

Below 0 % is the deep discharge: a few per cent of the capacity, over which the voltage of an NMC pack climbs from
2.54 V to 3.0 V per cell. A pack in that range must be woken gently before it may be charged.
"""

import math
from dataclasses import dataclass

from orchestrator.model import BatteryStatus
from orchestrator.sim.chemistry import NMC, Chemistry, interpolate

#: Where a BMU of this kind sets its status bits, °C; wider than any charge policy allows.
HIGH_C, LOW_C = 60.0, -20.0

#: The reference temperature of a resistance, and absolute zero.
REFERENCE_C, ZERO_C = 25.0, -273.15

#: How fast a fault can heat or cool a pack: slowly enough for the sensor's reading to stay plausible.
DRIVEN_K_PER_S = 3.0
#: … and how much at once when it begins. Read twice a second, that is not a jump.
DRIVEN_K = 2.0


@dataclass(frozen=True, slots=True)
class Readout:
    """What a BMU knows about its pack. None: not available (no current flows in that direction)."""

    voltage_v: float
    current_a: float  #: positive while charging
    status: int  #: bits, `BatteryStatus`
    time_to_full_min: float | None
    time_to_empty_min: float | None
    soc_pct: float
    soh_pct: float
    remaining_ah: float
    available_wh: float
    temperature_c: float


@dataclass(slots=True)
class Pack:
    """One battery. `charge_ah` is its charge above 0 %; negative in the deep discharge."""

    chemistry: Chemistry = NMC
    cells: int = 13
    capacity_ah: float = 20.0  #: nominal; `soh_pct` of it can be used
    deep_ah: float = 0.4  #: charge between 2.54 V and 3.0 V per cell
    resistance_ohm: float = 0.05  #: series resistance at 25 °C
    arrhenius_k: float = 0.0  #: its growth in the cold: by exp(this × (1/T − 1/298 K)); 0: none
    polarisation_ohm: float = 0.0  #: additional resistance …
    polarisation_s: float = 60.0  #: … with this time constant
    soh_pct: float = 100.0
    temperature_c: float = 20.0
    ambient_c: float = 20.0
    heat_j_per_k: float = 6000.0  #: about 6 kg of cells and their case
    cooling_w_per_k: float = 2.0
    charge_ah: float = 0.0
    polarisation_v: float = 0.0
    current_a: float = 0.0  #: positive while charging
    bias_v: float = 0.0  #: added to the open-circuit voltage by a fault
    leaky: bool = False  #: a fault: incoming charge is lost
    driven_c: float | None = None  #: a fault drives the temperature to this value and holds it

    @property
    def usable_ah(self) -> float:
        """The charge between 0 and 100 % at this state of health."""
        return self.capacity_ah * self.soh_pct / 100

    @property
    def soc(self) -> float:
        """The true state of charge, 0 … 1; outside that range when overcharged or deeply discharged."""
        return self.charge_ah / self.usable_ah

    @property
    def ocv_v(self) -> float:
        """The voltage right after the current has stopped; with polarisation it keeps falling from there."""
        chemistry, deep = self.chemistry, self.charge_ah < 0
        cell_v = (
            interpolate(chemistry.deep, self.charge_ah / self.deep_ah) if deep else interpolate(chemistry.ocv, self.soc)
        )
        return self.cells * cell_v + self.polarisation_v + self.bias_v

    @property
    def series_ohm(self) -> float:
        """The resistance at the present temperature."""
        if not self.arrhenius_k:
            return self.resistance_ohm
        colder = 1 / (self.temperature_c - ZERO_C) - 1 / (REFERENCE_C - ZERO_C)
        return self.resistance_ohm * math.exp(self.arrhenius_k * colder)

    @property
    def voltage_v(self) -> float:
        """The terminal voltage with the present current."""
        return self.ocv_v + self.current_a * self.series_ohm

    def set_soc(self, pct: float) -> None:
        """Set the pack's state of charge; −100 is the bottom of the deep discharge."""
        self.charge_ah = self.usable_ah * pct / 100 if pct >= 0 else self.deep_ah * pct / 100

    def advance(self, dt_s: float, current_a: float) -> None:
        """Let `current_a` flow for `dt_s`; it stays the present current afterwards."""
        if not self.leaky:
            self.charge_ah += current_a * dt_s / 3600
        self.current_a = current_a
        polarisation_w = self._polarise(dt_s)
        if self.driven_c is None:
            self._warm(dt_s, polarisation_w)
        else:
            self._drive(dt_s, self.driven_c)

    def _polarise(self, dt_s: float) -> float:
        """The mean heat of the polarisation during `dt_s`."""
        if not self.polarisation_ohm:
            return 0.0
        before_v, settled_v = self.polarisation_v, self.current_a * self.polarisation_ohm
        self.polarisation_v += (settled_v - before_v) * -math.expm1(-dt_s / self.polarisation_s)
        return (before_v * before_v + self.polarisation_v * self.polarisation_v) / 2 / self.polarisation_ohm

    def _warm(self, dt_s: float, polarisation_w: float) -> None:
        series_w = self.current_a * self.current_a * self.series_ohm
        # A warmer pack has less resistance, which acts like additional cooling.
        kelvin = self.temperature_c - ZERO_C
        cooling_w_per_k = self.cooling_w_per_k + series_w * self.arrhenius_k / (kelvin * kelvin)
        surplus_w = series_w + polarisation_w - self.cooling_w_per_k * (self.temperature_c - self.ambient_c)
        share = -math.expm1(-dt_s * cooling_w_per_k / self.heat_j_per_k)
        self.temperature_c += surplus_w / cooling_w_per_k * share

    def _drive(self, dt_s: float, target_c: float) -> None:
        step_k = DRIVEN_K_PER_S * dt_s
        self.temperature_c += min(max(target_c - self.temperature_c, -step_k), step_k)
        if self.temperature_c == target_c == self.ambient_c:
            self.driven_c = None  # back at the natural temperature

    def status(self) -> int:
        """The status bits set by the pack's own state."""
        cell_v = self.voltage_v / self.cells
        active = (
            (BatteryStatus.OVER_VOLTAGE, cell_v > self.chemistry.high_cell_v),
            (BatteryStatus.LOW_VOLTAGE, cell_v < self.chemistry.low_cell_v),
            (BatteryStatus.HIGH_TEMPERATURE, self.temperature_c > HIGH_C),
            (BatteryStatus.LOW_TEMPERATURE, self.temperature_c < LOW_C),
        )
        return sum(1 << bit for bit, is_set in active if is_set)

    def readout(self) -> Readout:
        """Everything that the BMU measures and counts, now."""
        remaining_ah = max(self.charge_ah, 0.0)
        idle = abs(self.current_a) < 0.05
        return Readout(
            voltage_v=self.voltage_v,
            current_a=self.current_a,
            status=self.status(),
            time_to_full_min=_minutes(self.usable_ah - remaining_ah, self.current_a) if not idle else None,
            time_to_empty_min=_minutes(remaining_ah, -self.current_a) if not idle else None,
            soc_pct=min(max(self.soc * 100, 0.0), 100.0),
            soh_pct=self.soh_pct,
            remaining_ah=remaining_ah,
            available_wh=remaining_ah * self.ocv_v,
            temperature_c=self.temperature_c,
        )


def _minutes(charge_ah: float, current_a: float) -> float | None:
    """How long `current_a` takes to move that charge; None if it flows the other way."""
    return max(charge_ah, 0.0) / current_a * 60 if current_a > 0 else None
