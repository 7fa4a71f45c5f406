"""The campaign: every proof on the whole service in virtual time, in its long form, one after another.

    python -m tests.proof                 grid, scripts, calls, environment
    python -m tests.proof grants          only this one: ten million events for 128 bays on one supply, in five minutes
    python -m tests.proof feeds           only this one: a meter on the supply of the whole service, in some minutes
    python -m tests.proof core            only this one, which takes longer than those four together
    python -m tests.proof seeds           only this one: which proof finds which bug, into docs/proofs.md

Each has its own main with more options: `tests.proof.whole_grid`, `campaign`, `nth_call`, `environment`, `grants`,
`feeds`, `exploring`, `seeds`.
"""

import argparse
import resource
import sys
import time
from collections.abc import Callable, Mapping, Sequence

from tests.proof import campaign, environment, exploring, feeds, grants, nth_call, seeds, whole_grid
from tests.proof.report import say

PARTS: Mapping[str, tuple[str, Callable[[Sequence[str]], int]]] = {
    "grid": ("every state × every row of the fault table × what the line is just doing", whole_grid.main),
    "scripts": ("random fault scripts", campaign.main),
    "calls": ("every call of a charge made to fail in turn, with each of its errors, once and lasting", nth_call.main),
    "environment": ("random trouble with lines, disk, bus, people, over lives of the gateway", environment.main),
    "grants": ("many bays on one supply: random events, and every state of three", grants.main),
    "feeds": ("bays on a supply in the whole service, with a meter on the feed", feeds.main),
    "core": ("everything that the core can come to", exploring.main),
    "seeds": ("the proofs themselves: every hole that was closed, opened again", seeds.main),
}


USUAL = ("grid", "scripts", "calls", "environment")


def cpu_s() -> float:
    """The CPU time of this process and of the children it has waited for."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def main(argv: Sequence[str] | None = None) -> int:
    """The given parts in order; 1 if any found something."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    chosen = parser.parse_args(argv).parts or USUAL
    if unknown := set(chosen) - set(PARTS):
        parser.error(f"no part {', '.join(sorted(unknown))}: there are {', '.join(PARTS)}")
    began_s = time.monotonic()
    found = []
    for name in PARTS:
        if name in chosen:
            about, run = PARTS[name]
            say(f"\n--- {name}: {about}\n")
            before_s = cpu_s()
            if run([]):
                found.append(name)
            say(f"{cpu_s() - before_s:.0f} s of one core")
    say(
        f"\n{time.monotonic() - began_s:.0f} s; "
        + (f"FOUND SOMETHING: {', '.join(found)}" if found else "nothing found")
    )
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
