"""From a decoded reading that means stop to the stop frame handed to the port: only our own code lies in between.

From the moment the BMU's high temperature is visible in its view, before the control loop wakes, to the return of the
write to the pty; 16 bays, emulators in another process. "Line idle": no poll was under way meanwhile. Otherwise the
rest of that transaction, at most 120 ms, comes first; the time after its last byte is shown as well.
"""

import json
import random
import time
from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series
from benchmarks.stations import Controllers, Station, module, one_station, plant, wait_until_charging

BAYS = 16
WARM_C, HOT_C = 44.0, 45.0
GAP_S = (0.15, 0.45)
#: Every stop is handed over long before this.
AFTER_S = 1.0
IDLE = Goal(median=2.0, p99=10.0)
IN_FLIGHT = Goal(p99=120.0 + 10.0)


@dataclass(frozen=True, slots=True)
class Stop:
    """One stop, milliseconds."""

    in_flight: bool
    took_ms: float
    after_line_free_ms: float


def timed(station: Station) -> list[str]:
    """The service with its two clocks."""
    return module("latency_service", str(station.station_file()), str(HOT_C))


def measure(effort: Effort) -> Iterator[Result]:
    """Mostly idle on a fast line; on one with a slow converter (80 ms), in flight about half of the time."""
    stops = list(_stops("real", effort.choose(3, 0)))
    stops += _stops("delayed", effort.choose(4, 1))
    idle = [stop.took_ms for stop in stops if not stop.in_flight]
    flying = [stop for stop in stops if stop.in_flight]
    yield Result("hot reading decoded → stop handed over, line idle", "ms", Series("ours", idle), goal=IDLE)
    waited = Series("ours", [stop.took_ms for stop in flying])
    yield Result("the same, transaction in flight", "ms", waited, goal=IN_FLIGHT)
    after = Series("ours", [stop.after_line_free_ms for stop in flying])
    yield Result("… of that, after the transaction's last byte", "ms", after, goal=IDLE)


def _stops(line: str, rounds: int) -> Iterator[Stop]:
    phase = random.Random(line)  # noqa: S311 - no secret
    with plant(BAYS, 1, "--temperature", str(WARM_C), "--line", line) as (process, directory):
        stations = one_station(process, directory)
        for _ in range(rounds):
            with Controllers(stations, timed) as controllers:
                wait_until_charging(process, controllers)
                time.sleep(1.0)
                for number in phase.sample(range(1, BAYS + 1), BAYS):
                    time.sleep(phase.uniform(*GAP_S))
                    process.inject("over_temperature", number)
                time.sleep(AFTER_S)
            yield from map(_stop, controllers.running[0].output.splitlines())
            process.ask({"inject": "heal"})
            process.ask({"set": {"temperature_c": WARM_C}})


def _stop(text: str) -> Stop:
    times = json.loads(text)
    hot_s, stop_s = times["hot_s"], times["stop_s"]
    in_flight = hot_s < times["free_s"]  # also if the poll began after the reading but before it was reported
    return Stop(in_flight, 1000 * (stop_s - hot_s), 1000 * (stop_s - times["free_s"]))
