"""The cost of `orchestrator simulate`: one charge of four hours, and many of them on all cores.

One charge is measured in processor time of its thread, against the same one simulated tick by tick. The many are a
sweep, in wall-clock time, without the start of its processes.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from time import perf_counter, thread_time

from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series
from orchestrator.config.load import load_policy, load_scenario
from orchestrator.config.scenario import Scenario, Visit
from orchestrator.workbench.processes import cores
from orchestrator.workbench.simulate.simulation import simulate
from orchestrator.workbench.simulate.sweep import Axis, played

POLICY = "li-ion-48v"
HOURS = 4.0
#: A whole charge within a second; a thousand in a minute.
ONE, MANY = Goal(median=1000.0), Goal(median=60_000 / 1000)


def charge() -> Scenario:
    """A pack of 40 Ah from 10 % to full in less than four hours."""
    visit = Visit(battery="pack-1", from_h=0, soc_pct=10)
    return replace(load_scenario("deep-discharge"), hours=HOURS, visits=(visit,))


def measure(effort: Effort) -> Iterator[Result]:
    """One charge alone, and one of many."""
    scenario, policy = charge(), load_policy(POLICY)
    short = replace(scenario, hours=HOURS / effort.choose(1, 8))
    ours = Series("ours", _times_ms(lambda: simulate(policy, scenario), effort.choose(40, 3), thread_time))
    ticks = _times_ms(lambda: simulate(policy, short, stretch=False), effort.choose(3, 1), thread_time)
    every = Series("every tick", [took_ms * HOURS / short.hours for took_ms in ticks])
    yield Result("simulate, a charge of 4 h", "ms", ours, every, ONE, processor_time=True)
    yield Result(
        "simulate --sweep, each charge of 4 h", "ms", Series("all cores", _sweep_ms(scenario, effort)), goal=MANY
    )


def _sweep_ms(scenario: Scenario, effort: Effort) -> list[float]:
    points = effort.choose(100, 8)
    axis = Axis(("finish.taper.below_a",), tuple(f"{1 + i / points:.4f}" for i in range(points)))
    with cores() as pool:

        def sweep() -> object:
            return played(POLICY, scenario, [axis], pool, lambda *_: None)

        sweep()
        return [took_ms / points for took_ms in _times_ms(sweep, effort.choose(3, 1), perf_counter)]


def _times_ms(work: Callable[[], object], runs: int, clock: Callable[[], float]) -> list[float]:
    samples = []
    for _ in range(runs):
        begin_s = clock()
        work()
        samples.append((clock() - begin_s) * 1000)
    return samples
