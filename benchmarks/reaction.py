"""From a change of the plant to the first stop byte at the emulator: our service and the naive controller compared.

Both times are the emulator's. Faults are injected at random phases, in one charging bay after another; then all
controllers end, the bays heal, and new controllers start the next round, so nothing of the last one remains.
"""

import random
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series
from benchmarks.stations import (
    Controllers,
    Side,
    Station,
    a_station_each,
    is_charging,
    naive,
    one_station,
    ours,
    plant,
    wait_until_charging,
)
from orchestrator.sim.client import PlantProcess

#: Warm enough for `over_temperature` (2 K at once) to cross the limit of 45 °C at that moment.
WARM_C = 44.0
#: The time between two injections is uniformly distributed in this range: a multiple of no period.
GAP_S = (0.1, 0.4)
#: After the last injection: a stop not seen by then counts as missing.
PATIENCE_S = 4.0
#: Single-bay stations running side by side, each on its own bus; few enough to leave the machine half idle.
STATIONS = 12


@dataclass(frozen=True, slots=True)
class Case:
    """One row of the table; `runs` 0 leaves it out."""

    what: str
    fault: str
    runs: int
    quick_runs: int = 0
    bays: int = 1
    bitrate: int | None = None
    share: float | None = None  #: the goal: at most this share of the naive controller's time
    worst_ms: float | None = None  #: the goal: at most this


#: Voltage, current and status bits are read every sweep, temperature twice a second (`devices/bus_budget.py`). The
#: naive controller reads no status bits.
CASES = (
    Case("over-voltage → stop byte, 1 bay", "over_voltage", 108, 12, share=1 / 2),
    Case("status bit → stop byte, 1 bay", "status_bits", 48, worst_ms=120.0),
    Case("over-temperature → stop byte, 1 bay", "over_temperature", 48, 12, worst_ms=600.0),
    Case("reverse polarity → stop byte, 1 bay", "reverse_polarity", 24),
    Case("BMU silent → stop byte, 1 bay", "bmu_silent", 24),
    Case("over-voltage → stop byte, 16 bays", "over_voltage", 112, 16, bays=16, share=1 / 10),
    Case("the same, all on 250 kbit/s", "over_voltage", 32, bays=16, bitrate=250_000, share=1 / 10),
)


def measure(effort: Effort) -> Iterator[Result]:
    """A row per case. The naive controller knows no bit rate, so it is measured once for each fault and size."""
    known: dict[tuple[str, int], Series] = {}
    for case in CASES:
        runs = effort.choose(case.runs, case.quick_runs)
        if not runs:
            continue
        series = Series("ours", *_react(case, ours, runs))
        if (case.fault, case.bays) not in known:
            known[case.fault, case.bays] = Series("naive", *_react(case, naive, runs))
        beside = known[case.fault, case.bays]
        yield Result(case.what, "ms", series, beside, _goal(case))


def _goal(case: Case) -> Goal | None:
    return Goal(p99=case.worst_ms, share=case.share) if case.worst_ms or case.share else None


def _react(case: Case, side: Side, runs: int) -> tuple[list[float], int]:
    """Milliseconds of all stops, and the number of missing ones."""
    phase = random.Random(case.what)  # noqa: S311 - no secret
    reactions: list[float | None] = []
    bays, buses = (case.bays, 1) if case.bays > 1 else (STATIONS, STATIONS)
    with plant(bays, buses, "--temperature", str(WARM_C)) as (process, directory):
        stations = one_station(process, directory, case.bitrate) if buses == 1 else a_station_each(process, directory)
        while len(reactions) < runs:
            reactions += _round(process, stations, side, case.fault, phase)
            process.ask({"inject": "heal"})
            process.ask({"set": {"temperature_c": WARM_C}})
    stopped = [1000 * reaction for reaction in reactions if reaction is not None]
    return stopped, len(reactions) - len(stopped)


def _round(
    process: PlantProcess, stations: Sequence[Station], side: Side, fault: str, phase: random.Random
) -> list[float | None]:
    """Each bay's reaction in s; None without a stop."""
    numbers = [number for station in stations for number in station.numbers]
    phase.shuffle(numbers)
    with Controllers(stations, side) as controllers:
        wait_until_charging(process, controllers)
        time.sleep(1.0)
        for number in numbers:
            if not is_charging(process.state(number)):
                raise RuntimeError(f"bay {number} stopped by itself:\n{controllers.log()}")
            time.sleep(phase.uniform(*GAP_S))
            process.inject(fault, number)
        stops = _stops(process)
        controllers.check()
        return stops


def _stops(process: PlantProcess) -> list[float | None]:
    end_s = time.monotonic() + PATIENCE_S
    while True:
        bays = process.ask({"query": "state"})["bays"]
        stops = [bay["first_stop_s"] - bay["injected_s"] if bay["first_stop_s"] else None for bay in bays]
        if None not in stops or time.monotonic() > end_s:
            return stops
        time.sleep(0.25)
