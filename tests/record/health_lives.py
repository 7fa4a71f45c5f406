"""Lives of batteries whose ageing is known, against the health that the record makes of their charges.

    python -m tests.record.health_lives 1000        1000 2: the same with devices twice as far off as is assumed

A life is a direct model of charges; what a BMU and a charger would report goes through the product's own fold into its
own records, in the form in which the service writes them (`test_health.py` holds both against a charge of the bench).
The devices are as their documents have them: volts in 10 mV, current in 10 mA, temperature in 0.1 °C, SOC in whole per
cent, rounded or cut off. The documents state no accuracy; what is drawn here is ordinary for such devices: currents
within 1 % and 20 mA, volts within 0.5 %, a thermometer within 1 K (each in 95 devices of 100), a SOC whose scale is
within 1 % and that drifts between charges. The true values are those of the pack at the end of its last charge.
"""

import math
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from random import Random
from statistics import median

from orchestrator.record import lines, measured, spread
from orchestrator.record.capacity import Estimate
from orchestrator.record.charge import Charge
from orchestrator.record.health import Health, health
from orchestrator.record.lines import Record
from orchestrator.record.measured import Measured
from orchestrator.record.met import Met, Trouble
from orchestrator.record.stamp import Stamp
from orchestrator.record.stretch import Point
from orchestrator.record.ulid import CHANCE, after

#: 2026-01-01T00:00:00Z, when a life ends; a year.
END_S, YEAR_S = 1_767_225_600.0, 365.25 * 86_400.0
#: Only the last charges of a life are made: more than the product looks at.
MOST = 80
BATTERY = "B-0042"
STEPS_A = (2.0, 5.0, 8.0, 11.0, 14.0)
#: A charge slows down from here on, and from here on it tapers off.
SLOWER_PCT, TAPER_PCT = 90.0, 95.0
#: An open-circuit voltage of one cell, roughly: at 0 % and at 100 %.
EMPTY_V, FULL_V = 3.4, 4.18


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

    def charges(self) -> Iterator[Record]:
        """The records of its last charges; the last one is at the end of its life."""
        id_ = ""
        for number in reversed(range(self.count)):
            ago_s = number * self.every_s + (self.dice.uniform(0.0, 0.4) * self.every_s if number else 0.0)
            id_ = after(id_, END_S - ago_s, bytes(CHANCE))
            yield self._record(id_, ago_s)

    def _record(self, id_: str, ago_s: float) -> Record:
        years = max(self.years - ago_s / YEAR_S, 0.0)
        now = OneCharge(self, years)
        soh_pct = round(100.0 if self.stale_soh else 100 * self.capacity_ah(years) / self.rated_ah)
        end = Stamp(END_S - ago_s, 540, 1e6, "boot")
        head = {
            "station": "a station", "bay": "bay-1", "port": "/dev/ttyX",
            "battery": {"id": BATTERY, "source": "typed", "can": "can0", "node": "0x10"},
            "policy": {"name": "p", "sha256": "0" * 12, "capacity_ah": self.rated_ah, "end_v": 4.2 * self.cells},
            "software": "0", "by": None, "contactor_fitted": False,
        }  # fmt: skip
        whole = Charge(id_, head, end.back(now.t_s), end, end, 0.0, None, 1, measured=now.measured)
        spreads = (None, (float(soh_pct),) * 4, *spread.NONE[2:])
        return lines.end(replace(whole, spreads=spreads, trouble=now.trouble, result={"id": "full", "params": {}}))


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
        if abs(self.jump_at - self.soc_pct) < math.inf and self.jump_at < self.soc_pct and abs(self.jump_pct) > 5:
            self.trouble = Trouble((Met("soc_jump", "WARN", {"id": "soc_jump"}),))

    def _halt(self) -> None:
        """A pause, or the death of the service, which costs up to 30 s of the Ah."""
        amps = self.amps
        died = self.life.dice.random() < 0.5
        self._set(0.0)
        if died:
            self.measured = measured.broken(self.measured)
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
        before, self.amps = self.amps, amps
        self.soc_pct += 100 * amps * seconds / 3600 / self.capacity_ah
        self.charger_ah += (amps * life.charger_gain + (life.charger_zero_a if amps else 0.0)) * seconds / 3600
        self.bmu_ah += (amps * life.bmu_gain + (life.bmu_zero_a if amps else 0.0)) * seconds / 3600
        settled_v = amps * life.slow_share * life.ohm(self.years, self.pack_c, self.soc_pct)
        self.slow_v += (settled_v - self.slow_v) * -math.expm1(-seconds / life.slow_s)
        self.t_s += seconds
        self._look()
        self.amps = amps if amps else before * 0.0

    def _charge_to(self, soc_pct: float) -> None:
        """The moments at which the SOC that is shown changes, each seen by a reading up to 1.5 s later."""
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


@dataclass(frozen=True, slots=True)
class Verdict:
    """One estimate against the truth."""

    true: float
    estimate: Estimate | None

    @property
    def inside(self) -> bool:
        return self.estimate is not None and self.estimate.low <= self.true <= self.estimate.high

    @property
    def width(self) -> float:
        """Half of the interval, as a share of the value."""
        assert self.estimate is not None
        return (self.estimate.high - self.estimate.low) / 2 / self.estimate.value

    @property
    def off(self) -> float:
        assert self.estimate is not None
        return self.estimate.value / self.true - 1


def live(seed: int, most: int = MOST, worse: float = 1.0) -> tuple[Life, Health, Verdict, Verdict]:
    """One life: the health found, capacity and resistance against the truth."""
    life = Life(seed, worse)
    life.count = min(life.count, most)
    found = health(BATTERY, life.charges())
    ohm = found.resistance.mohm if found.resistance is not None else None
    return life, found, Verdict(life.capacity_ah(life.years), found.capacity), Verdict(1000 * life.ohm(life.years), ohm)


def main(count: int, worse: float) -> int:
    """Report the coverage over this many lives; 1 if one is not 95 % ± 2."""
    verdicts: dict[str, list[Verdict]] = {"capacity": [], "resistance": []}
    warned = Counter[tuple[bool, bool]]()
    for seed in range(count):
        life, found, *both = live(seed, worse=worse)
        for name, verdict in zip(verdicts, both, strict=True):
            verdicts[name].append(verdict)
        if found.soh_pct is not None:
            warned[life.stale_soh, found.parts] += 1
    right = True
    for name, every in verdicts.items():
        said = [one for one in every if one.estimate is not None]
        share = 100 * sum(one.inside for one in said) / len(said)
        right = right and abs(share - 95.0) <= 2.0
        print(
            f"{name}: {share:.1f} % of {len(said)} intervals hold the true value ({count - len(said)} lives: none); "
            f"± {100 * median(one.width for one in said):.1f} % in the middle, "
            f"± {100 * sorted(one.width for one in said)[len(said) * 9 // 10]:.1f} % in nine of ten; "
            f"off by {100 * median(abs(one.off) for one in said):.1f} %, {100 * median(one.off for one in said):+.1f} %"
        )
    print(f"the BMU's SOH follows: {warned[False, True]} of {warned[False, True] + warned[False, False]} warned of")
    print(f"it stays at 100 %: {warned[True, True]} of {warned[True, True] + warned[True, False]} warned of")
    return 0 if right else 1


if __name__ == "__main__":
    arguments = [float(one) for one in sys.argv[1:]]
    sys.exit(main(int(arguments[0]) if arguments else 100, arguments[1] if len(arguments) > 1 else 1.0))
