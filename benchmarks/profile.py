"""Where the processor time of a charging station goes: by thread and, with `--spy`, by function.

    python -m benchmarks.profile 64 1                   # 64 bays on one bus
    python -m benchmarks.profile 64 1 --spy stacks.raw  # needs py-spy on the PATH; pip install py-spy

Time by thread is the kernel's, and exact. Shares of functions are from samples of the threads that hold the GIL, so
they are shares of a thread's Python code, without its system calls. py-spy does not pause the service, since the
guardian would take a paused one for hung and stop its chargers; some stacks are therefore torn.
"""

import argparse
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks import machine, stacks, threads
from benchmarks.footprint import BITRATE, SETTLE_S, sdo_requests
from benchmarks.stations import Controllers, Station, module, one_station, plant, wait_until_charging

SAMPLES_HZ = 100  #: with 64 bays, py-spy cannot keep up with many more


def main(argv: Sequence[str] | None = None) -> int:
    """Start a station, wait until every bay charges, measure, print."""
    arguments = _arguments(argv)
    print(machine.line(machine.facts()), flush=True)
    try:
        found, reads_per_s = _measured(arguments)
    except RuntimeError as error:
        print(f"profile: {error}", file=sys.stderr)
        return 1
    buses = f"{arguments.buses} bus{'es' if arguments.buses > 1 else ''}"
    print(f"{arguments.bays} bays charging on {buses}, {reads_per_s:.0f} SDO reads/s")
    print("\n".join(threads.rows(found, arguments.bays)))
    if arguments.spy:
        lines = arguments.spy.read_text(encoding="utf-8", errors="replace").splitlines()
        print("\n".join(stacks.rows(stacks.by_role(lines))))
    return 0


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.profile", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bays", type=int, choices=range(1, 129), metavar="BAYS", help="1 to 128")
    parser.add_argument("buses", type=int, choices=range(1, 17), metavar="BUSES", help="1 to 16")
    parser.add_argument(
        "--seconds", type=int, default=20, choices=range(1, 3601), metavar="S", help="measure and sample so long (20)"
    )
    parser.add_argument("--spy", type=Path, metavar="FILE", help="record stacks there, and show shares by function")
    arguments = parser.parse_args(argv)
    if arguments.spy and not shutil.which("py-spy"):
        parser.error("--spy needs py-spy, which is not on the PATH: pip install py-spy")
    return arguments


def named(station: Station) -> list[str]:
    """The service, with threads that have names."""
    return module("named", str(station.station_file()))


def _measured(arguments: argparse.Namespace) -> tuple[Mapping[str, threads.Times], float]:
    """The threads' times and the SDO reads in a second; RuntimeError with the service's last words if it has ended."""
    with (
        plant(arguments.bays, arguments.buses) as (process, directory),
        Controllers(one_station(process, directory, BITRATE), named) as running,
    ):
        wait_until_charging(process, running)
        time.sleep(SETTLE_S)
        pids = running.pids
        begin_s, reads, before = time.monotonic(), sdo_requests(process), threads.until_now(pids)
        time.sleep(arguments.seconds)
        took_s, reads, after = time.monotonic() - begin_s, sdo_requests(process) - reads, threads.until_now(pids)
        running.check()
        if arguments.spy:
            record(pids[-1], arguments.seconds, arguments.spy)
            running.check()
    return threads.by_role(before, after, took_s), reads / took_s


def record(pid: int, seconds: int, path: Path) -> None:
    """Sample the controller; RuntimeError with py-spy's own words if it does not work."""
    what = ["--pid", str(pid), "--nonblocking", "--gil", "--rate", str(SAMPLES_HZ), "--duration", str(seconds)]
    how = ["--threads", "--format", "raw", "--output", str(path)]
    run = subprocess.run(
        [shutil.which("py-spy") or "py-spy", "record", *what, *how],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
    )  # fmt: skip
    if run.returncode:
        raise RuntimeError(f"py-spy has ended with status {run.returncode}:\n{run.stdout}")


if __name__ == "__main__":
    sys.exit(main())
