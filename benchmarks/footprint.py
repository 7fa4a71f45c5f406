"""Memory and processor time of a station while every bay charges; the emulators run in a separate process.

The service is two processes, guardian and controller. Processor time is for both together; memory is shown for each.
The floor for processor time is `bare.py`, with as many SDO reads and polls as measured for the service.
"""

import json
import os
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.effort import Effort
from benchmarks.report import Goal, Result, Series
from benchmarks.stations import Controllers, Side, module, naive, one_station, ours, plant, wait_until_charging, wirings
from orchestrator.sim.client import PlantProcess

BITRATE = 250_000  #: of each bus: SDO reads take at most 30 % of it
SETTLE_S = 3.0  #: the work of starting is over by then
WINDOW_S = 1.0
MANY = 64


@dataclass(slots=True)
class Use:
    """The usage of one controller, window by window."""

    controller_mib: list[float] = field(default_factory=list)
    guardian_mib: list[float] = field(default_factory=list)
    cpu_pct: list[float] = field(default_factory=list)
    reads_per_s: float = 0.0  #: SDO reads on all buses


def measure(effort: Effort) -> Iterator[Result]:
    """1, 16 and 64 bays on one bus, 64 on four."""
    windows = effort.choose(8, 3)
    one, sixteen = _use(ours, 1, 1, windows), _use(ours, 16, 1, windows)
    plain, plain_sixteen = _use(naive, 1, 1, windows), _use(naive, 16, 1, windows)
    yield from _memory("1 bay", one, plain, Goal(p99=45.0))
    yield from _memory("16 bays", sixteen, plain_sixteen)
    if effort.quick:
        yield _each_further_bay(one, sixteen, 16, plain, plain_sixteen)
    else:
        many = _use(ours, MANY, 1, windows)
        yield from _memory(f"{MANY} bays", many)
        yield Result(f"RSS, {MANY} bays, guardian", "MiB", Series("ours", many.guardian_mib), goal=Goal(p99=13.4))
        yield _each_further_bay(one, many, MANY, plain, plain_sixteen)
    yield _busy("CPU, 1 bay", one.cpu_pct, Series("naive", plain.cpu_pct))
    yield _busy("CPU, 16 bays", sixteen.cpu_pct, Series("naive", plain_sixteen.cpu_pct))
    if not effort.quick:
        yield from _processor(1, many, windows)
        yield from _processor(4, _use(ours, MANY, 4, windows), windows)


def _memory(bays: str, use: Use, beside: Use | None = None, goal: Goal | None = None) -> Iterator[Result]:
    other = Series("naive", beside.controller_mib) if beside else None
    yield Result(f"RSS, {bays}, controller", "MiB", Series("ours", use.controller_mib), other, goal)


def _each_further_bay(one: Use, many: Use, bays: int, naive_one: Use, naive_sixteen: Use) -> Result:
    first, naive_first = statistics.median(one.controller_mib), statistics.median(naive_one.controller_mib)
    each = Series("ours", [(mib - first) / (bays - 1) for mib in many.controller_mib])
    naive_each = Series("naive, of 16", [(mib - naive_first) / 15 for mib in naive_sixteen.controller_mib])
    return Result(f"RSS, each further bay, of {bays}", "MiB", each, naive_each, Goal(p99=0.4))


def _processor(buses: int, use: Use, windows: int) -> Iterator[Result]:
    """All bays together and per bay, against the same traffic in bare loops."""
    bare = _use(_bare(use.reads_per_s / buses), MANY, buses, windows)
    on = f"{buses} bus{'es' if buses > 1 else ''}"
    beside = f"bare loops, {use.reads_per_s:.0f} SDO/s"
    yield _busy(f"CPU, {MANY} bays, {on}", use.cpu_pct, Series(beside, bare.cpu_pct), Goal(median=25.0))
    each, bare_each = ([pct / MANY for pct in one.cpu_pct] for one in (use, bare))
    yield _busy(f"… of that, each bay, {on}", each, Series(beside, bare_each))


def _busy(what: str, cpu_pct: Sequence[float], beside: Series, goal: Goal | None = None) -> Result:
    return Result(what, "%", Series("ours", cpu_pct), beside, goal, processor_time=True)


def _bare(reads_per_s: float) -> Side:
    return lambda station: module("bare", json.dumps(wirings(station)), str(reads_per_s))


def _use(side: Side, bays: int, buses: int, windows: int) -> Use:
    with (
        plant(bays, buses) as (process, directory),
        Controllers(one_station(process, directory, BITRATE), side) as running,
    ):
        if side in (ours, naive):
            wait_until_charging(process, running)
        time.sleep(SETTLE_S)
        return _watch(process, running, windows)


def _watch(process: PlantProcess, running: Controllers, windows: int) -> Use:
    use, pids = Use(), running.pids
    begin_s, reads = time.monotonic(), sdo_requests(process)
    for _ in range(windows):
        window_s, spent_s = time.monotonic(), sum(map(_cpu_s, pids))
        time.sleep(WINDOW_S)
        use.cpu_pct.append(100 * (sum(map(_cpu_s, pids)) - spent_s) / (time.monotonic() - window_s))
        *guardian_mib, controller_mib = map(_rss_mib, pids)
        use.controller_mib.append(controller_mib)
        use.guardian_mib += guardian_mib
    running.check()
    use.reads_per_s = (sdo_requests(process) - reads) / (time.monotonic() - begin_s)
    return use


def sdo_requests(process: PlantProcess) -> int:
    """Of all bays, since the start."""
    return sum(bay["sdo_requests"] for bay in process.ask({"query": "state"})["bays"])


def _cpu_s(pid: int) -> float:
    """CPU seconds of all its threads, in nanosecond resolution; /proc/PID/stat has ticks of 10 ms."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return sum(int((task / "schedstat").read_text(encoding="ascii").split()[0]) for task in tasks) / 1e9


def _rss_mib(pid: int) -> float:
    """Its resident memory, shared files included (VmRSS)."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
