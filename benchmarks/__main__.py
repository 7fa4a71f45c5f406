"""`python -m benchmarks`: the service against floors and a naive controller, as medians and p99 over many runs."""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from benchmarks import (
    before,
    can_reads,
    decoding,
    footprint,
    gateway,
    laststop,
    latency,
    machine,
    reaction,
    simulating,
    startup,
    stepping,
)
from benchmarks.effort import Effort
from benchmarks.report import Result, table, write_json

PARTS: Mapping[str, Callable[[Effort], Iterator[Result]]] = {
    "gateway": gateway.measure,
    "reaction": reaction.measure,
    "latency": latency.measure,
    "laststop": laststop.measure,
    "start": startup.measure,
    "footprint": footprint.measure,
    "can": can_reads.measure,
    "step": stepping.measure,
    "decoder": decoding.measure,
    "simulate": simulating.measure,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the requested measurements and print the table. The exit status only tells whether they succeeded."""
    arguments = _arguments(argv)
    facts = machine.facts()
    print(machine.line(facts), flush=True)
    results: list[Result] = []
    try:
        for name in arguments.only or PARTS:
            begin_s = time.monotonic()
            results += PARTS[name](Effort(quick=arguments.quick))
            print(f"{name}: {time.monotonic() - begin_s:.0f} s", file=sys.stderr, flush=True)
    finally:
        earlier: before.Before | None = arguments.before
        print(table(results, list(earlier.columns(results, gateway.factor())) if earlier else None))
    if arguments.json:
        write_json(arguments.json, facts, results)
    return 0


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer runs and parts: less than two minutes")
    parser.add_argument("--only", action="append", choices=PARTS, help="only this part; may be repeated")
    parser.add_argument("--json", type=_writable, metavar="FILE", help="write the figures there, too")
    parser.add_argument(
        "--before", type=before.load, metavar="FILE", help="show what an earlier --json FILE says, and the change"
    )
    return parser.parse_args(argv)


def _writable(name: str) -> Path:
    """Tried before minutes are measured in vain."""
    path = Path(name)
    try:
        path.open("a").close()
    except OSError as error:
        raise argparse.ArgumentTypeError(f"{name} cannot be written ({error.strerror})") from error
    return path


if __name__ == "__main__":
    sys.exit(main())
