"""The shipped policies charge: each one in a grid of ordinary charges, in a hall of 2 to 38 °C.

Full or at the target, nothing latches, and the current step changes a few times at most. `python -m
tests.workbench.test_ordinary_charges` plays the fine grid.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise, product

import pytest

from orchestrator.config.load import load_policy, load_scenario
from orchestrator.config.policy import CellType, Policy
from orchestrator.config.scenario import (
    BatteryModel,
    Cell,
    ChargerModel,
    Defect,
    Scenario,
    Sensor,
    SensorFault,
    Visit,
    Weather,
)
from orchestrator.config.shipped import shipped_names
from orchestrator.config.station import Limits
from orchestrator.core.faults import ROW, Clear
from orchestrator.keys import Range
from orchestrator.model import State
from orchestrator.workbench.simulate.figures import figures
from orchestrator.workbench.simulate.simulation import Run, simulate

#: A charger for a pack of this current: its steps, as shares of it.
STEPS = (0.05, 0.2, 0.4, 0.7, 1.0)
#: End voltage of a charger, V per cell.
CV_V = {CellType.NMC: 4.20, CellType.NCA: 4.20, CellType.LFP: 3.60}
MOST_CHANGES = 6
#: Tolerance of "full" or "at the target": the resolution of a BMU, and the rest left by a taper.
WITHIN_PCT = 2.5


@dataclass(frozen=True)
class Ordinary:
    """One charge."""

    policy: str
    hall_c: float
    soc_pct: float
    soh_pct: float = 100.0
    told_more_pct: float = 0.0  #: by how much the BMU's SOC is wrong

    @property
    def scenario(self) -> Scenario:
        policy = load_policy(self.policy)
        shipped = load_scenario("hot-afternoon")
        wrong = SensorFault(sensor=Sensor.SOC_PCT, defect=Defect.OFFSET, by=self.told_more_pct, from_h=0.0)
        return replace(
            shipped,
            hours=60.0,
            weather=(Weather(at_h=0, ambient_c=self.hall_c),),
            charger=charger_for(policy),
            limits=Limits(voltage_v=60.0, current_a=100.0, temperature_c=Range(0, 55)),
            batteries={"pack-1": replace(pack_for(policy, shipped.batteries["pack-1"]), soh_pct=self.soh_pct)},
            visits=(Visit(battery="pack-1", from_h=0, soc_pct=self.soc_pct, temperature_c=self.hall_c),),
            sensors=(wrong,) if self.told_more_pct else (),
        )


def charger_for(policy: Policy) -> ChargerModel:
    """A suitable charger for such a pack: that of the shipped stations, or one in proportion."""
    pack = policy.pack
    shipped = pack.current_a <= 14
    steps_a = (2.0, 5.0, 8.0, 11.0, 14.0) if shipped else tuple(share * pack.current_a for share in STEPS)
    cv_v = CV_V[pack.chemistry] * pack.cells_in_series
    return ChargerModel(steps_a=steps_a, cv_v=cv_v, cutoff_a=0.4 if shipped else 0.01 * pack.current_a)


def pack_for(policy: Policy, model: BatteryModel) -> BatteryModel:
    pack = policy.pack
    assert pack.capacity_ah is not None
    size = pack.cells_in_series / 13 * 40 / pack.capacity_ah
    return replace(
        model,
        cells=Cell.LFP if pack.chemistry is CellType.LFP else Cell.NMC,
        cells_in_series=pack.cells_in_series,
        capacity_ah=pack.capacity_ah,
        resistance_ohm=model.resistance_ohm * size,
        polarisation_ohm=model.polarisation_ohm * size,
        heat_j_per_k=model.heat_j_per_k * pack.cells_in_series / 13 * pack.capacity_ah / 40,
        cooling_w_per_k=model.cooling_w_per_k * (pack.cells_in_series / 13 * pack.capacity_ah / 40) ** 0.67,
    )


def problems(ordinary: Ordinary) -> Iterator[str]:
    """Everything wrong with a charge."""
    run = simulate(load_policy(ordinary.policy), ordinary.scenario)
    found = figures(run)
    target_pct = run.policy.finish.target_soc_pct - (
        ordinary.told_more_pct if run.policy.finish.target_soc_pct < 100 else 0
    )
    if run.trail.spans[-1].state is not State.FULL:
        yield f"ends {run.trail.spans[-1].state}: {run.trail.spans[-1].why}"
    if found.left_pct is None or abs(found.left_pct - target_pct) > WITHIN_PCT:
        yield f"ends at {found.left_pct:.1f} %, {target_pct:g} % is the target"
    if latched := [name for name in found.faults if ROW[name].clear is Clear.RESET]:
        yield f"latches {latched}"
    if changes(run) > MOST_CHANGES:
        yield f"{changes(run)} changes of the step"


def changes(run: Run) -> int:
    """For the whole charge, across every pause."""
    steps = [span.step for span in run.trail.spans if span.step is not None]
    return sum(before != now for before, now in pairwise(steps))


POLICIES = shipped_names("policies")
SMALL = [
    *(Ordinary(policy, hall_c, 15.0) for policy, hall_c in product(POLICIES, (2.0, 5.0, 14.0, 38.0))),
    *(Ordinary(policy, 26.0, 60.0, soh_pct=75.0) for policy in POLICIES),
]


@pytest.mark.parametrize("ordinary", SMALL, ids=str)
def test_an_ordinary_charge_ends_as_it_should(ordinary: Ordinary) -> None:
    assert list(problems(ordinary)) == []


@pytest.mark.parametrize("told_more_pct", [-8.0, 8.0])
@pytest.mark.parametrize("policy", ["li-ion-48v", "li-ion-24v", "lfp-48v", "telecom-lfp-15s"])
def test_a_bmu_that_reads_wrong_does_not_end_a_full_charge(policy: str, told_more_pct: float) -> None:
    """A SOC reading 8 % too high left a pack at 91.5 %."""
    assert list(problems(Ordinary(policy, 20.0, 30.0, told_more_pct=told_more_pct))) == []


def test_nothing_chatters_on_a_hot_afternoon() -> None:
    """There were once 67 changes of the step, around a bound at 35 °C."""
    for policy in ("long-life-48v", "li-ion-48v"):
        run = simulate(load_policy(policy), load_scenario("hot-afternoon"))
        assert changes(run) <= 4, policy
    bound = {"pack.temperature_c[1]": "40", "current.temperature_c.rows[2].to": "40"}
    run = simulate(load_policy("long-life-48v", changes=bound), load_scenario("hot-afternoon"))
    assert changes(run) <= 4, "also where it waits for the evening, and the bound is in the middle of the charge"


def main() -> int:
    """The fine grid."""
    wrong = 0
    for policy, hall_c, soc_pct, soh_pct in product(
        POLICIES, [float(hall_c) for hall_c in range(2, 39, 3)], (5.0, 35.0, 70.0), (100.0, 70.0)
    ):
        ordinary = Ordinary(policy, hall_c, soc_pct, soh_pct)
        if found := list(problems(ordinary)):
            wrong += 1
            print(ordinary, *found, sep="\n    ")  # noqa: T201 - it is the purpose
    print(f"{wrong} of them are not as they should be")  # noqa: T201
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
