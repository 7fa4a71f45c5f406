"""When the controller itself failed: from its death, or from an emergency stop's exec, to the first stop byte.

The stop is seen by the emulators, in another process; their clock and ours are the same.
"""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series
from benchmarks.stations import Controllers, Station, a_station_each, ours, plant
from orchestrator.sim.client import PlantProcess

#: Single-bay stations, started together, that then die one after another, each on its own bus.
STATIONS = 8
#: The time between two deaths is uniformly distributed in this range: a multiple of no period.
GAP_S = (0.15, 0.45)
#: A service is under way after this many polls of its charger.
POLLS = 5
#: A stop not seen by then counts as missing.
STOPS_S = 5.0
#: A bare process of the same interpreter that opens the port and writes the single frame.
FLOOR = (
    "import os, sys, termios, tty; fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); tty.setraw(fd); "
    "line = termios.tcgetattr(fd); line[4] = line[5] = termios.B19200; termios.tcsetattr(fd, 0, line); "
    "os.write(fd, bytes.fromhex('AFFA900410900034AFA0'))"
)


def measure(effort: Effort) -> Iterator[Result]:
    """Deaths first, then emergency stops without a service."""
    rss_mib: list[float] = []
    for what, number, goal in (
        ("controller SIGKILL → stop byte", signal.SIGKILL, Goal(p99=20.0)),
        ("controller SIGSTOP → stop byte", signal.SIGSTOP, Goal(p99=600.0)),
    ):
        yield Result(what, "ms", Series("ours", *_deaths(number, effort.choose(64, 8), rss_mib)), goal=goal)
    yield Result("RSS, guardian", "MiB", Series("ours", rss_mib), goal=Goal(p99=14.0))
    yield from _estops(effort.choose(100, 10))


def _deaths(number: signal.Signals, runs: int, rss_mib: list[float]) -> tuple[list[float], int]:
    """Milliseconds of all stops, and the number of missing ones."""
    phase = random.Random(number.name)  # noqa: S311 - no secret
    took_ms: list[float | None] = []
    with plant(STATIONS, STATIONS) as (process, directory):
        stations = a_station_each(process, directory)
        while len(took_ms) < runs:
            enough = [polls + POLLS for polls in _polls(process)]
            with Controllers(stations, ours) as controllers:
                while not all(map(int.__ge__, _polls(process), enough)):
                    time.sleep(0.1)
                for bay, guardian in enumerate(controllers.running, start=1):
                    rss_mib.append(_rss_mib(guardian.pid))
                    time.sleep(phase.uniform(*GAP_S))
                    took_ms.append(_death(process, bay, _child(guardian.pid), number))
    return [ms for ms in took_ms if ms is not None], took_ms.count(None)


def _polls(process: PlantProcess) -> list[int]:
    return [bay["polls"] for bay in process.ask({"query": "state"})["bays"]]


def _death(process: PlantProcess, bay: int, pid: int, number: signal.Signals) -> float | None:
    process.inject("heal", bay)  # watch for the first stop from here on
    began_s = time.monotonic()
    os.kill(pid, number)
    return _first_stop_ms(process, bay, began_s)


def _first_stop_ms(process: PlantProcess, bay: int, began_s: float) -> float | None:
    """None if none came within STOPS_S."""
    while (stop_s := process.state(bay)["first_stop_s"]) is None and time.monotonic() < began_s + STOPS_S:
        time.sleep(0.02)
    return None if stop_s is None else 1000 * (stop_s - began_s)


def _estops(runs: int) -> Iterator[Result]:
    """From before the fork to the stop, with only a port and with a station file."""
    estop = [sys.executable, "-m", "orchestrator", "estop"]
    with plant(1) as (process, directory):
        station = Station(directory / "station", (1,), tuple(process.bays))
        port = str(process.bays[0]["port"])
        station.directory.mkdir()
        floor = Series("bare Python, one frame", *_runs(process, [sys.executable, "-c", FLOOR, port], runs))
        for what, args, limit_ms in (
            ("estop --port: exec → stop byte", ["--port", port], 60.0),
            ("estop STATION: exec → stop byte", [str(station.station_file())], 150.0),
        ):
            took = Series("ours", *_runs(process, [*estop, *args], runs))
            yield Result(what, "ms", took, floor, Goal(p99=limit_ms))


def _runs(process: PlantProcess, argv: Sequence[str], runs: int) -> tuple[list[float], int]:
    took_ms: list[float | None] = []
    for _ in range(runs):
        process.inject("heal")
        began_s = time.monotonic()
        with subprocess.Popen(argv, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
            took_ms.append(_first_stop_ms(process, 1, began_s))
            running.wait()
    return [ms for ms in took_ms if ms is not None], took_ms.count(None)


def _child(pid: int) -> int:
    return int(Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8"))


def _rss_mib(pid: int) -> float:
    """VmRSS."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="utf-8").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
