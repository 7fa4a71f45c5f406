"""`make reference`: the workbench's battery against PyBaMM's: the difference, and the speed of each.

Accuracy: the charge a policy made in each shipped scenario, as current and weather over time, is run again through
PyBaMM's Thevenin model with the same parameters and PyBaMM's own solver. Speed: one charge from 10 % to 1 A at constant
voltage, by `orchestrator simulate` with its policy deciding every step, and by PyBaMM's experiment runner, which
follows a fixed program and decides nothing.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np
import pybamm
from numpy.typing import NDArray

from orchestrator.config.load import load_policy, load_scenario
from orchestrator.config.scenario import Scenario, Visit
from orchestrator.config.shipped import shipped_names
from orchestrator.sim.pack import REFERENCE_C, ZERO_C, Pack
from orchestrator.workbench.simulate.plant import pack_of
from orchestrator.workbench.simulate.simulation import Run, simulate
from orchestrator.workbench.simulate.trail import Moment

POLICY = "li-ion-48v"
#: How far PyBaMM's state of charge reaches beyond 100 % here; it ends a simulation at its own 0 and 1.
OVER = 1.05
#: Goals: the maximum difference, as a share of 100 % and of the voltage.
GOAL_PCT = 1.0
#: The length of the charge used to measure speed.
HOURS = 4.0

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Apart:
    """The maximum difference of the two models over one visit of a battery."""

    soc_pct: float
    volts_pct: float
    kelvin: float


def main(argv: Sequence[str] | None = None) -> int:
    """Print both tables; the exit status tells whether the models agree within the goal."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reference", description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="of each speed, of which the median counts")
    arguments = parser.parse_args(argv)
    pybamm.set_logging_level("ERROR")
    found = {name: _scenario(name) for name in shipped_names("configs/scenarios")}
    print(f"{'scenario':16} {'SOC apart':>10} {'volts apart':>12} {'temperature apart':>18}")
    for name, apart in found.items():
        print(f"{name:16} {apart.soc_pct:8.3f} % {apart.volts_pct:10.3f} % {apart.kelvin:16.3f} K")
    for line in _speed(arguments.runs):
        print(line)
    return 0 if all(apart.soc_pct <= GOAL_PCT and apart.volts_pct <= GOAL_PCT for apart in found.values()) else 1


# --- accuracy --------------------------------------------------------------------------------------------------------


def _scenario(name: str) -> Apart:
    run = simulate(load_policy(POLICY), load_scenario(name))
    visits = [_visit(run, visit) for visit in run.scenario.visits]
    return Apart(*(max(getattr(apart, field) for apart in visits) for field in ("soc_pct", "volts_pct", "kelvin")))


def _visit(run: Run, visit: Visit) -> Apart:
    """One battery's visit, again through PyBaMM's model."""
    end_s = (visit.to_h if visit.to_h is not None else run.scenario.hours) * 3600
    moments = [m for m in run.trail.moments if visit.from_h * 3600 < m.t_s <= end_s and m.soc_pct is not None]
    pack = pack_of(run.scenario.batteries[visit.battery])
    t_s = _column(moments, lambda m: m.t_s)
    t_s -= t_s[0]
    solution = _solve(pack, moments, t_s)
    total_ah, held_ah = _range(pack)
    soc_pct = (solution["SoC"](t_s) * total_ah - held_ah) / pack.usable_ah * 100
    volts = solution["Voltage [V]"](t_s)
    ours_pct = _column(moments, lambda m: m.soc_pct)
    ours_v = _column(moments, lambda m: m.voltage_v)
    ours_c = _column(moments, lambda m: m.temperature_c)
    return Apart(
        float(np.abs(soc_pct - ours_pct).max()),
        float((np.abs(volts - ours_v) / volts).max() * 100),
        float(np.abs(solution["Cell temperature [degC]"](t_s) - ours_c).max()),
    )


def _column(moments: Sequence[Moment], value: Callable[[Moment], float | None]) -> Floats:
    return np.array([value(m) for m in moments], dtype=float)


def _solve(pack: Pack, moments: Sequence[Moment], t_s: Floats) -> pybamm.Solution:
    first = moments[0]
    total_ah, held_ah = _range(pack)
    current = pybamm.Interpolant(t_s, -_column(moments, lambda m: m.current_a), pybamm.t)
    weather = pybamm.Interpolant(t_s, _column(moments, lambda m: m.ambient_c) - ZERO_C, pybamm.t)
    values = parameters(pack)
    values.update(
        {
            "Current function [A]": current,
            "Ambient temperature [K]": lambda _t: weather,
            "Initial SoC": ((first.soc_pct or 0.0) / 100 * pack.usable_ah + held_ah) / total_ah,
            "Initial temperature [K]": (first.temperature_c or 0.0) - ZERO_C,
        }
    )
    solver = pybamm.IDAKLUSolver(rtol=1e-6, atol=1e-8)
    model = pybamm.equivalent_circuit.Thevenin()
    return pybamm.Simulation(model, parameter_values=values, solver=solver).solve(t_s)


def _range(pack: Pack) -> tuple[float, float]:
    """The charge between PyBaMM's 0 and 1 here, and the part of it below 0 %, in Ah."""
    return pack.deep_ah + OVER * pack.usable_ah, pack.deep_ah


def parameters(pack: Pack) -> pybamm.ParameterValues:
    """PyBaMM's parameters for the same battery; its jig has the ambient temperature."""
    total_ah, held_ah = _range(pack)
    deep = [((1 + share) * held_ah / total_ah, volts) for share, volts in pack.chemistry.deep if -1 <= share < 0]
    rest = [((held_ah + soc * pack.usable_ah) / total_ah, volts) for soc, volts in pack.chemistry.ocv if soc <= OVER]
    shares, volts = (np.array(column) for column in zip(*deep, *rest, strict=True))

    def series_ohm(celsius: pybamm.Symbol, _amps: pybamm.Symbol, _soc: pybamm.Symbol) -> pybamm.Symbol:
        colder = 1 / (celsius - ZERO_C) - 1 / (REFERENCE_C - ZERO_C)
        return pack.resistance_ohm * pybamm.exp(pack.arrhenius_k * colder)

    values = pybamm.ParameterValues("ECM_Example")
    values.update(
        {
            "Cell capacity [A.h]": total_ah,
            "Nominal cell capacity [A.h]": total_ah,
            "Upper voltage cut-off [V]": 1000.0,
            "Lower voltage cut-off [V]": 0.0,
            "Cell thermal mass [J/K]": pack.heat_j_per_k,
            "Cell-jig heat transfer coefficient [W/K]": pack.cooling_w_per_k,
            "Jig thermal mass [J/K]": 1.0,
            "Jig-air heat transfer coefficient [W/K]": 1e5,
            "Open-circuit voltage [V]": lambda soc: pybamm.Interpolant(shares, volts * pack.cells, soc),
            "R0 [Ohm]": series_ohm,
            "R1 [Ohm]": pack.polarisation_ohm,
            "C1 [F]": pack.polarisation_s / pack.polarisation_ohm,
            "Element-1 initial overpotential [V]": 0.0,
            "Entropic change [V/K]": 0.0,
        }
    )
    return values


# --- speed -----------------------------------------------------------------------------------------------------------


def _speed(runs: int) -> Iterator[str]:
    """Ours and theirs on the same charge: 14 A, then constant voltage down to 1 A, then rest."""
    shipped = load_scenario("deep-discharge")
    charge = replace(shipped, hours=HOURS, visits=(Visit(battery="pack-1", from_h=0, soc_pct=10),))
    policy = load_policy(POLICY, changes={"current.soc_pct.rows[1].max_a": "14", "finish.full.soc_pct": "100"})
    ours_s = _median_s(lambda: simulate(policy, charge), runs)
    experiment = _experiment(pack_of(charge.batteries["pack-1"]), charge)
    set_up_s = _median_s(lambda: experiment().solve(), runs)
    simulation = experiment()
    simulation.solve()
    solved_s = _median_s(simulation.solve, runs)
    yield ""
    yield f"a charge of {HOURS:g} h, processor time, median of {runs} runs"
    for name, took_s in (
        ("orchestrator simulate, every decision by decide()", ours_s),
        ("PyBaMM's experiment runner, model set up each time", set_up_s),
        ("PyBaMM's experiment runner, model set up before", solved_s),
    ):
        yield f"{name:52} {took_s * 1000:8.1f} ms  {HOURS * 3600 / took_s:12,.0f} × real time"


def _experiment(pack: Pack, charge: Scenario) -> Callable[[], pybamm.Simulation]:
    """The same charge as a PyBaMM experiment."""
    total_ah, held_ah = _range(pack)
    volts, most_a, kelvin = charge.charger.cv_v, charge.charger.steps_a[-1], charge.weather[0].ambient_c - ZERO_C
    steps = (f"Charge at {most_a} A until {volts} V", f"Hold at {volts} V until 1 A", "Rest for 1 hour")
    values = parameters(pack)
    values.update({"Ambient temperature [K]": kelvin, "Initial temperature [K]": kelvin})
    values.update({"Initial SoC": (0.1 * pack.usable_ah + held_ah) / total_ah})
    return lambda: pybamm.Simulation(
        pybamm.equivalent_circuit.Thevenin(), parameter_values=values, experiment=pybamm.Experiment(list(steps))
    )


def _median_s(play: Callable[[], object], runs: int) -> float:
    times = []
    for _ in range(runs):
        begin_s = time.process_time()
        play()
        times.append(time.process_time() - begin_s)
    return median(times)


if __name__ == "__main__":
    sys.exit(main())
