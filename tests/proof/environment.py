"""The environment's campaign: anything else on machine, line, bus and disk, over lives of the gateway.

python -m tests.proof.environment                    every scene, then 1,000 random scripts, on all processors
python -m tests.proof.environment --seed 104 -v      one of them again, with the service's output
python -m tests.proof.environment --scene NAME -v    a scene again
python -m tests.proof.environment --script FILE      a printed script (JSON)
"""

import argparse
import logging
import multiprocessing
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from tests.proof.hazards import Script, smaller
from tests.proof.lives import Lived, live
from tests.proof.report import say
from tests.proof.scenes import SCENES

#: At most this many plays to shrink a failure.
SHRINK_PLAYS = 120
RUNS = 1000
#: At most this many kinds of findings are shown, each with its smallest script.
SHOWN = 8


def quiet() -> None:
    """A driver left by a killed process logs a complaint when it is garbage-collected."""
    logging.getLogger("can").setLevel(logging.CRITICAL)


def play(name: str | int) -> tuple[str, Lived]:
    """A scene by its name, a random script by its seed."""
    quiet()
    return (
        (f"seed {name}", live(Script.of_seed(name))) if isinstance(name, int) else (f"scene {name}", live(SCENES[name]))
    )


def campaign(names: Iterable[str | int], workers: int, until_s: float) -> Iterator[tuple[str, Lived]]:
    """Each script as it is played; none starts after `until_s` (monotonic)."""

    def in_time() -> Iterator[str | int]:
        for name in names:
            if time.monotonic() > until_s:
                return
            yield name

    if workers == 1:
        yield from map(play, in_time())
        return
    with multiprocessing.get_context("fork").Pool(workers) as pool:
        waiting = in_time()
        while some := list(islice(waiting, 32 * workers)):
            yield from pool.imap_unordered(play, some, chunksize=4)


def smallest(script: Script) -> Script:
    """The smallest script found by shrinking that breaks one of the same invariants."""
    wrong, plays = live(script).kinds, 0
    again = True
    while again:
        again = False
        for one in smaller(script):
            plays += 1
            if plays > SHRINK_PLAYS:
                return script
            if live(one).kinds & wrong:
                script, again = one, True
                break
    return script


def show(name: str, lived: Lived) -> None:
    """The findings, how to reproduce them, and the smallest script with one."""
    kind, which = name.split(" ", 1)
    say(f"\n{name}: python -m tests.proof.environment --{kind} {which!r} -v\n  " + "\n  ".join(lived.wrong))
    small = smallest(lived.script)
    say("smallest script:\n" + small.to_json() + "\n  " + "\n  ".join(live(small).wrong))


@dataclass(slots=True)
class Tally:
    """The results of many scripts."""

    played: int = 0
    charged: int = 0
    virtual_s: float = 0.0
    kinds: Counter[str] = field(default_factory=Counter)
    found: list[tuple[str, Lived]] = field(default_factory=list)

    def add(self, name: str, lived: Lived) -> None:
        self.played += 1
        self.charged += lived.charged
        self.virtual_s += lived.script.end_s
        self.kinds.update(lived.kinds)
        if lived.wrong:
            self.found.append((name, lived))


def one(script: Script, name: str, *, verbose: bool) -> int:
    """A single script, with all output."""
    lived = live(script)
    say("\n".join([script.to_json(), *(lived.said if verbose else ())]))
    say("\n".join((f"{name}:", *lived.wrong)) if lived.wrong else f"{name}: nothing found")
    return 1 if lived.wrong else 0


def many(names: Iterable[str | int], options: argparse.Namespace) -> int:
    """All of them; 1 if anything was found."""
    began_s, tally = time.monotonic(), Tally()
    for name, lived in campaign(names, options.workers, began_s + options.minutes * 60):
        tally.add(name, lived)
        if lived.wrong and options.names:
            say(f"{name}: {'; '.join(lived.wrong)}")
        if lived.wrong and options.until_found:
            return 1
    say(
        f"{tally.played} scripts, {tally.virtual_s / 3600:.1f} h of a station of three bays in "
        f"{time.monotonic() - began_s:.0f} s; {tally.charged} chargers ran; {len(tally.found)} scripts found something"
    )
    for kind, times in tally.kinds.most_common():
        say(f"{times:6} {kind}")
    firsts = {min(lived.kinds): (name, lived) for name, lived in reversed(tally.found)}
    for name, lived in list(firsts.values())[: 0 if options.names else SHOWN]:
        show(name, lived)
    return 1 if tally.found else 0


def main(argv: Sequence[str] | None = None) -> int:
    """Play, report and shrink failures; 1 if there were any."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=RUNS, help="random scripts (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: %(default)s)")
    parser.add_argument(
        "--minutes", type=float, default=60.0, help="no script begins after this (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, help="only this one")
    parser.add_argument("--scene", choices=SCENES, help="only this one", metavar="NAME")
    parser.add_argument(
        "--only", action="append", default=[], choices=SCENES, metavar="NAME", help="these scenes and no other scripts"
    )
    parser.add_argument("--script", type=Path, help="only the script in this file")
    parser.add_argument("--names", action="store_true", help="a line for each script that finds something, no more")
    parser.add_argument("--until-found", action="store_true", help="end with the first finding")
    parser.add_argument("--skip", default="", help="scenes and seeds to leave out, with | between them")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("-v", "--verbose", action="store_true", help="what the service said")
    options = parser.parse_args(argv)
    quiet()
    if options.script is not None:
        return one(Script.from_json(options.script.read_text(encoding="utf-8")), "script", verbose=options.verbose)
    if options.scene is not None:
        return one(SCENES[options.scene], options.scene, verbose=options.verbose)
    if options.seed is not None:
        return one(Script.of_seed(options.seed), f"seed {options.seed}", verbose=options.verbose)
    skipped = set(options.skip.split("|"))
    names = options.only or [*SCENES, *range(options.first, options.first + options.runs)]
    return many([name for name in names if str(name) not in skipped], options)


if __name__ == "__main__":
    sys.exit(main())
