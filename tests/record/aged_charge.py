"""One charge of a battery whose ageing is known, as its devices report it.

It is a direct model: a charge is followed closely where the current changes, and is otherwise only seen when the SOC
shown changes. What is seen goes through the product's own fold.
"""

import math

from orchestrator.record import measured
from orchestrator.record.measured import Measured
from orchestrator.record.met import Met, Trouble
from orchestrator.record.stretch import Point
from tests.record.aged_battery import Life

#: A charge slows down from here on, and from here on it tapers off.
SLOWER_PCT, TAPER_PCT = 90.0, 95.0
#: An open-circuit voltage of one cell, roughly: at 0 % and at 100 %.
EMPTY_V, FULL_V = 3.4, 4.18


class OneCharge:
    """One charge, as its devices report it, through the product's fold."""

    def __init__(self, life: Life, years: float) -> None:
        self.life, self.years, dice = life, years, life.dice
        self.measured, self.trouble, self.t_s = Measured(), Trouble(), 0.0
        season_k = life.season_k * math.sin(2 * math.pi * years)
        self.pack_c = life.hall_c + season_k + dice.gauss(0.0, 2.0)
        self.soc_pct = begin = dice.uniform(min(life.deepest_pct, 60.0), 75.0)
        self.end_pct = min(life.target_pct, 99.99)
        self.capacity_ah = life.capacity_ah(years) * (1 + 0.0005 * (self.pack_c - 25.0))
        self.begin_pct, self.off_pct = begin, (dice.gauss(0.0, life.drift_pct), dice.gauss(0.0, life.drift_pct / 2))
        self.jump_at = dice.uniform(begin, self.end_pct) if dice.random() < 0.05 else math.inf
        self.jump_pct = dice.choice((-6.0, 4.0, 8.0))
        self.amps, self.slow_v = 0.0, 0.0
        self.charger_ah = self.bmu_ah = 0.0
        self._run()

    def _run(self) -> None:
        dice = self.life.dice
        self._wait(4.0)
        cold = self.pack_c < 15.0
        for until_pct, amps in ((SLOWER_PCT, 5.0 if cold else 14.0), (TAPER_PCT, 2.0 if cold else 8.0)):
            until = min(until_pct, self.end_pct)
            if self.soc_pct >= until:
                continue
            self._set(amps)
            halt_pct = dice.uniform(self.soc_pct, until) if dice.random() < 0.1 else math.inf
            if halt_pct < until:
                self._charge_to(halt_pct)
                self._halt()
                self._set(amps)
            self._charge_to(until)
        while self.soc_pct < self.end_pct and self.amps > 0.7:  # the taper: ever less
            self.amps *= 0.95
            self._charge_to(min(self.soc_pct + 0.25, self.end_pct))
        self._set(0.0)
        if self.jump_at < self.soc_pct and abs(self.jump_pct) > 5:  # the core doubts the SOC then
            self.trouble = Trouble((Met("soc_jump", "WARN", {"id": "soc_jump"}),))

    def _halt(self) -> None:
        """A pause, or the death of the service, which costs up to 30 s of the Ah."""
        amps = self.amps
        died = self.life.dice.random() < 0.5
        self._set(0.0)
        if died:
            self.measured = measured.from_fields(measured.as_fields(self.measured))
            self.charger_ah -= self.life.dice.uniform(0.0, 30.0) * amps / 3600
        self._wait(4.0)

    # --- the pack -----------------------------------------------------------------------------------------------------

    def _set(self, amps: float) -> None:
        """Another current, seen closely: decisions are half a second apart."""
        self._wait(1.0)
        ramp_s = self.life.dice.uniform(0.2, 1.0)
        self._flow(0.5, self.amps + (amps - self.amps) * min(0.5 / ramp_s, 1.0))
        self.amps = amps
        self._wait(3.0)

    def _wait(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.5)):
            self._flow(0.5, self.amps)

    def _flow(self, seconds: float, amps: float) -> None:
        life = self.life
        self.amps = amps
        self.soc_pct += 100 * amps * seconds / 3600 / self.capacity_ah
        self.charger_ah += (amps * life.charger_gain + (life.charger_zero_a if amps else 0.0)) * seconds / 3600
        self.bmu_ah += (amps * life.bmu_gain + (life.bmu_zero_a if amps else 0.0)) * seconds / 3600
        settled_v = amps * life.slow_share * life.ohm(self.years, self.pack_c, self.soc_pct)
        self.slow_v += (settled_v - self.slow_v) * -math.expm1(-seconds / life.slow_s)
        self.t_s += seconds
        self._look()

    def _charge_to(self, soc_pct: float) -> None:
        """Each change of the SOC shown is seen by a reading up to 1.5 s later."""
        while self.soc_pct < soc_pct and self.amps > 0:
            rate = 100 * self.amps / 3600 / self.capacity_ah  # % a second
            lasts_s = (min(soc_pct, self._next_pct()) - self.soc_pct) / rate + self.life.dice.uniform(0.01, 1.5)
            self._flow(lasts_s, self.amps)

    # --- its BMU ------------------------------------------------------------------------------------------------------

    def _look(self) -> None:
        life = self.life
        ocv_v = life.cells * (EMPTY_V + (FULL_V - EMPTY_V) * self.soc_pct / 100) + self.slow_v
        volts = life.volts_gain * (ocv_v + self.amps * life.ohm(self.years, self.pack_c, self.soc_pct))
        amps = self.amps * life.bmu_gain + life.bmu_zero_a
        point = Point(
            self.t_s, self.shown_pct, round(volts, 2), round(amps, 2), round(self.pack_c + life.off_k, 1),
            self.charger_ah, self.bmu_ah,
        )  # fmt: skip
        self.measured = measured.follow(self.measured, self.t_s, point, 4.2 * life.cells)

    @property
    def shown_pct(self) -> float:
        exact = min(max(self._exact_pct(self.soc_pct), 0.0), 100.0)
        return float(math.floor(exact) if self.life.cuts_off else round(exact))

    def _exact_pct(self, soc_pct: float) -> float:
        """What the BMU computes: its error has drifted since it was last right, and shrinks on the way to full."""
        share = (soc_pct - self.begin_pct) / max(self.end_pct - self.begin_pct, 1.0)
        off_pct = self.off_pct[0] + (self.off_pct[1] - self.off_pct[0]) * share
        jumped_pct = self.jump_pct if soc_pct >= self.jump_at else 0.0
        return soc_pct + off_pct + self.life.soc_scale * (soc_pct - self.begin_pct) + jumped_pct

    def _next_pct(self) -> float:
        """The true SOC at which the shown one rises next."""
        now = self._exact_pct(self.soc_pct)
        border = math.floor(now) + 1.0 if self.life.cuts_off else math.floor(now + 0.5) + 0.5
        slope = (self._exact_pct(self.soc_pct + 1e-3) - now) * 1e3
        rise_pct = (border - now) / slope if 0.2 < slope < 5.0 else 0.5
        return self.soc_pct + max(rise_pct, 1e-4)
