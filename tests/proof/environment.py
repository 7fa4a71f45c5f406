"""The environment's campaign: whatever else is on the machine, the line, the bus and the disk, over lives of the gateway.

python -m tests.proof.environment                    every scene, then 1,000 random scripts, on all processors
python -m tests.proof.environment --seed 104 -v      one of them again, with what the service said
python -m tests.proof.environment --scene NAME -v    a scene again
python -m tests.proof.environment --script FILE      a script that was printed (JSON)
"""

import argparse
import logging
import multiprocessing
import os
import resource
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path

from tests.proof.hazards import Script, smaller
from tests.proof.lives import Lived, live
from tests.proof.report import say
from tests.proof.scenes import SCENES

#: A failure is made smaller with at most this many plays.
SHRINK_PLAYS = 120
RUNS = 1000


def quiet() -> None:
    """A driver that is left by a killed process complains to the log when it is collected."""
    logging.getLogger("can").setLevel(logging.CRITICAL)


def play(name: str | int) -> tuple[str, Lived]:
    """A scene by its name, a random script by its seed."""
    quiet()
    return (f"seed {name}", live(Script.of_seed(name))) if isinstance(name, int) else (f"scene {name}", live(SCENES[name]))


def campaign(names: Iterable[str | int], workers: int, until_s: float) -> Iterator[tuple[str, Lived]]:
    """Each script, as it is played; no more begin after `until_s` (monotonic)."""

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
    """The smallest script on the way down that breaks one of the same invariants."""
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


def show(name: str, lived: Lived, *, shrink: bool) -> None:
    """What was found, and how to see it again."""
    say(f"\n{name}: python -m tests.proof.environment --{name.replace(' ', ' ')} -v\n  " + "\n  ".join(lived.wrong))
    if shrink:
        small = smallest(lived.script)
        say("smallest script:\n" + small.to_json() + "\n  " + "\n  ".join(live(small).wrong))


def cpu_s() -> float:
    """What this process and those that it has waited for have used of a core."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def main(argv: Sequence[str] | None = None) -> int:
    """Play, tell, and shrink what failed; 1 if anything did."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=RUNS, help="random scripts (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: %(default)s)")
    parser.add_argument("--minutes", type=float, default=60.0, help="no script begins after this (default: %(default)s)")
    parser.add_argument("--seed", type=int, help="only this one")
    parser.add_argument("--scene", choices=SCENES, help="only this one")
    parser.add_argument("--script", type=Path, help="only the script in this file")
    parser.add_argument("--first-finding", action="store_true", help="end with the first finding, do not shrink it")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("-v", "--verbose", action="store_true", help="what the service said")
    arguments = parser.parse_args(argv)
    quiet()
    single = next((one for one in (arguments.scene, arguments.seed) if one is not None), None)
    if arguments.script is not None or single is not None:
        script = Script.from_json(arguments.script.read_text(encoding="utf-8")) if arguments.script else None
        name, lived = ("script", live(script)) if script else play(single)  # type: ignore[arg-type]
        say("\n".join([lived.script.to_json(), *(lived.said if arguments.verbose else ())]))
        say("\n".join((f"{name}:", *lived.wrong)) if lived.wrong else f"{name}: nothing found")
        return 1 if lived.wrong else 0
    began_s, used_s = time.monotonic(), cpu_s()
    names: list[str | int] = [*SCENES, *range(arguments.first, arguments.first + arguments.runs)]
    found: list[tuple[str, Lived]] = []
    kinds: Counter[str] = Counter()
    played = charged = 0
    virtual_s = 0.0
    for name, lived in campaign(names, arguments.workers, began_s + arguments.minutes * 60):
        played, charged, virtual_s = played + 1, charged + lived.charged, virtual_s + lived.script.end_s
        kinds.update(lived.kinds)
        if lived.wrong:
            found.append((name, lived))
            if arguments.first_finding:
                say(f"{name}: {'; '.join(lived.wrong)}")
                return 1
    say(
        f"{played} scripts, {virtual_s / 3600:.1f} h of a station of three bays in {time.monotonic() - began_s:.0f} s; "
        f"{charged} chargers ran; {len(found)} scripts found something"
    )
    for kind, times in kinds.most_common():
        say(f"{times:6} {kind}")
    firsts = {min(lived.kinds): (name, lived) for name, lived in reversed(found)}
    for name, lived in list(firsts.values())[:8]:
        show(name, lived, shrink=True)
    say(f"{cpu_s() - used_s:.0f} s of one core")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
