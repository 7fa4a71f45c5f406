"""The soak: long lives on lines that lose 1 % of all frames and damage 0.1 %, serial and CAN.

    python -m tests.proof.soak                            30 days in virtual time, and an hour in real time beside them
    python -m tests.proof.soak --days 2 --minutes 0       only two days
    python -m tests.proof.soak --days 0 --minutes 5       only five minutes of the real processes

Failures: a missed stop (a condition of `truth.py` that persists), a fault that latches though nothing is wrong, growing
memory. A charge stopped though nothing is wrong is counted.
"""

import argparse
import multiprocessing
import os
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from tests.proof import days, real_time
from tests.proof.days import DAY_S, Lived
from tests.proof.real_time import Real, Sample
from tests.proof.report import say

#: Growth from a process's first day or quarter to its last that still counts as flat.
FLAT_MIB = 1.0


def _live(job: tuple[int, int]) -> Lived:
    os.nice(10)  # the real processes beside it have priority
    return days.live(*job)


def shares(total: int, workers: int) -> list[tuple[int, int]]:
    """(seed, days) for each process: as many days in a row as possible."""
    each, more = divmod(total, workers)
    return [(seed, each + (seed <= more)) for seed in range(1, workers + 1) if each + (seed <= more)]


def told_of_days(lives: Sequence[Lived]) -> Iterator[str]:
    """The virtual part in figures."""
    total = sum(lived.days for lived in lives)
    cpu_s = sum(lived.cpu_s for lived in lives)
    yield (
        f"\n{total} days in virtual time, {len(lives)} lives: {sum(x.stays for x in lives)} batteries, "
        f"{sum(x.charges for x in lives)} charged full, {sum(x.faults for x in lives)} faults injected; "
        f"{cpu_s:.0f} s of one core, {total * DAY_S / cpu_s:.0f} times as fast as life"
    )
    yield from _listed("missed stops and broken invariants", [line for x in lives for line in x.violations])
    yield from _listed("false latches", [line for x in lives for line in x.false_latches])
    stops = [line for x in lives for line in x.false_stops]
    yield f"false stops: {len(stops)}" + _kinds(line.split(", ")[1].split(":")[0] for line in stops)
    latched = sum((x.latched for x in lives), Counter[tuple[str, str]]())
    yield "latched, and rightly so: " + ", ".join(
        f"{name} → {fault} {n}" for (name, fault), n in sorted(latched.items())
    )
    for lived in lives:
        yield (
            f"memory after day 1, {len(lived.mib) // 2 + 1} and {len(lived.mib)}: "
            + ", ".join(f"{lived.mib[at]:.1f} MiB" for at in _ends(lived.mib))
            + "; Python objects: "
            + ", ".join(str(lived.objects[at]) for at in _ends(lived.mib))
        )


def _ends(row: Sequence[object]) -> tuple[int, int, int]:
    return 0, len(row) // 2, len(row) - 1


def told_of_real(real: Real, minutes: float) -> Iterator[str]:
    """The part with real processes in figures."""
    yield (
        f"\n{minutes:g} real minutes: {real.departures} batteries, {real.charges} charged full, {real.faults} faults "
        f"in mid-charge, {real.requests} operator's requests; the service ended with status {real.status}"
    )
    for name, stops_s in sorted(real.stops_s.items()):
        times = f"{statistics.median(stops_s):6.3f} {max(stops_s):6.3f}" if stops_s else "no stop byte came through"
        yield f"{name:22} {len(stops_s):3}   stop after, s: median, max {times}"
    yield from _listed("missed stops", real.missed)
    yield from _listed("false latches", real.false_latches)
    yield from _listed("false stops", real.false_stops)
    yield from _listed("restarts by the guardian", real.restarts)
    yield from _listed("other oddities", real.odd)
    for name, samples in real.samples.items():
        yield f"{name:10} {_flatness(longest(samples))}"


def longest(samples: Sequence[Sample]) -> list[Sample]:
    """Of the longest-lived process."""
    pid, _ = Counter(sample.pid for sample in samples).most_common(1)[0]
    return [sample for sample in samples if sample.pid == pid]


def _flatness(samples: Sequence[Sample]) -> str:
    quarters = [samples[at * len(samples) // 4 : (at + 1) * len(samples) // 4] for at in range(4)]

    def by_quarters(field: str) -> str:
        return " ".join(f"{statistics.median(getattr(x, field) for x in quarter):g}" for quarter in quarters if quarter)

    lived_s = samples[-1].t_s - samples[0].t_s
    return (
        f"{lived_s:.0f} s by quarters: {by_quarters('mib')} MiB; {by_quarters('descriptors')} descriptors; "
        f"{by_quarters('threads')} threads"
    )


def _listed(what: str, lines: Sequence[str]) -> Iterator[str]:
    yield f"{what}: {len(lines)}"
    yield from (f"  {line}" for line in lines)


def _kinds(names: Iterable[str]) -> str:
    counted = Counter(names)
    return f" ({', '.join(f'{name} {n}' for name, n in counted.most_common())})" if counted else ""


def grown(lives: Sequence[Lived], real: Real | None) -> list[str]:
    """Processes whose memory is not flat."""
    wrong = [
        f"a life grew from {x.mib[0]:.1f} to {x.mib[-1]:.1f} MiB" for x in lives if x.mib[-1] > x.mib[0] + FLAT_MIB
    ]
    for name, every in (real.samples if real else {}).items():
        samples = longest(every)
        second, last = samples[len(samples) // 4 : len(samples) // 2], samples[-len(samples) // 4 :]
        if second and statistics.median(x.mib for x in last) > statistics.median(x.mib for x in second) + FLAT_MIB:
            wrong.append(f"the {name} grew from {second[0].mib:.1f} to {last[-1].mib:.1f} MiB")
    return wrong


def main(argv: Sequence[str] | None = None) -> int:
    """Run and report; 1 if there was any failure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--days", type=int, default=30, help="in virtual time (default: %(default)s)")
    parser.add_argument("--minutes", type=float, default=60, help="of real processes (default: %(default)s)")
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="lives at a time (default: %(default)s)"
    )
    arguments = parser.parse_args(argv)
    began_s = time.monotonic()
    with multiprocessing.get_context("spawn").Pool(arguments.workers + 1) as pool:
        real_one = pool.apply_async(real_time.live, (arguments.minutes,)) if arguments.minutes else None
        lives = pool.map(_live, shares(arguments.days, arguments.workers), chunksize=1)
        real = real_one.get() if real_one else None
    if lives:
        say("\n".join(told_of_days(lives)))
    if real:
        say("\n".join(told_of_real(real, arguments.minutes)))
    wrong = grown(lives, real)
    say("\n".join(_listed("memory that grows", wrong)))
    say(f"{time.monotonic() - began_s:.0f} s of wall clock")
    bad = [line for x in lives for line in (*x.violations, *x.false_latches)]
    bad += [*real.missed, *real.false_latches, *real.odd] if real else []
    return 1 if bad or wrong or (real and real.status) else 0


if __name__ == "__main__":
    sys.exit(main())
