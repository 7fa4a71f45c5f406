"""Lives of batteries whose ageing is known, against the health that the record makes of their charges.

    python -m tests.record.health_lives 1000        1000 2: the same with devices twice as far off as is assumed

What the model of a charge lets BMU and charger report goes through the product's own fold into its own records, in the
form in which the service writes them: `test_measured.py` holds both against a charge of the bench. The true values are
those of the pack at the end of its last charge. What is drawn, and from where, stands in `aged_battery.py`.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

from orchestrator.record import lines, spread
from orchestrator.record.capacity import Estimate
from orchestrator.record.charge import Charge
from orchestrator.record.health import Health, health
from orchestrator.record.lines import Record
from orchestrator.record.measured import Measured
from orchestrator.record.met import Trouble
from orchestrator.record.stamp import Stamp
from orchestrator.record.ulid import CHANCE, after
from tests.record.aged_battery import MOST, YEAR_S, Life
from tests.record.aged_charge import OneCharge

#: 2026-01-01T00:00:00Z, when a life ends.
END_S = 1_767_225_600.0
BATTERY = "B-0042"


def charges_of(life: Life) -> Iterator[Record]:
    """The records of its last charges; the last one is at the end of its life."""
    id_ = ""
    for number in reversed(range(life.count)):
        ago_s = number * life.every_s + (life.dice.uniform(0.0, 0.4) * life.every_s if number else 0.0)
        id_ = after(id_, END_S - ago_s, bytes(CHANCE))
        yield _record(life, id_, ago_s)


def _record(life: Life, id_: str, ago_s: float) -> Record:
    years = max(life.years - ago_s / YEAR_S, 0.0)
    now = OneCharge(life, years)
    soh_pct = round(100.0 if life.stale_soh else 100 * life.capacity_ah(years) / life.rated_ah)
    end = Stamp(END_S - ago_s, 540, 1e6, "boot")
    return recorded(id_, end, now.t_s, now.measured, now.trouble, (life.rated_ah, 4.2 * life.cells, float(soh_pct)))


def recorded(
    id_: str, end: Stamp, lasted_s: float, found: Measured, trouble: Trouble, pack: tuple[float, float, float]
) -> Record:
    """The record of an ended charge of a pack of these Ah, with this end voltage and this SOH."""
    rated_ah, end_v, soh_pct = pack
    head = {
        "station": "a station", "bay": "bay-1", "port": "/dev/ttyX",
        "battery": {"id": BATTERY, "source": "typed", "can": "can0", "node": "0x10"},
        "policy": {"name": "p", "sha256": "0" * 64, "capacity_ah": rated_ah, "end_v": end_v},
        "software": "0", "by": None, "contactor_fitted": False,
    }  # fmt: skip
    whole = Charge(id_, head, end.back(lasted_s), end, end, 0.0, None, 1, trouble=trouble, measured=found)
    spreads = (None, (soh_pct,) * 4, *spread.NONE[2:])
    return lines.end(replace(whole, spreads=spreads, result={"id": "full", "params": {}}))


def records(seed: int = 8, count: int = 12) -> list[dict[str, Any]]:
    """Charges of one life in a hall of 25 °C, as JSON has them."""
    life = Life(seed)
    life.count, life.hall_c, life.season_k, life.deepest_pct = count, 25.0, 0.0, 10.0
    return [json.loads(json.dumps(record)) for record in charges_of(life)]


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
    found = health(BATTERY, charges_of(life))
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
