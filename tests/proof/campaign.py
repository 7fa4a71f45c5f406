"""The campaign: random fault scripts on the whole service in virtual time; failures replayable and shrunk.

python -m tests.proof.campaign                    1,000 scripts on all processors
python -m tests.proof.campaign --seed 1249 -v     one of them again, with the injected faults
python -m tests.proof.campaign --script FILE      a printed script (JSON)
"""

import argparse
import multiprocessing
import os
import statistics
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

from tests.proof.play import Injected, Played, play
from tests.proof.report import say
from tests.proof.script import SEE_S, Script, shrink

#: At most this many plays to shrink a failure.
SHRINK_PLAYS = 400
#: A shorter fault need not have shown.
SHOWN_S = SEE_S - 0.5
#: These need not be noticed: harmless until something else happens, or indistinguishable from a healthy bay.
WHY_UNSEEN = {
    "frozen_temperature": "a temperature that stays is what a healthy pack shows",
    "ignore_stop": "shows when a stop is due",
    "rogue_run": "shows when the charger stands still",
    "precharge_no_rise": "shows in a precharge of ours; a charge ends by its Ah and hours",
    "stale_reading": "answers within the SDO time-out are good",
    "command_ignored": "the lowest step is the one in use in a precharge",
    "over_current": "a precharge stays below the step's limit",
    "frozen_charger": "shows after a minute of which the battery's values are not still",
    "soc_jump": "the SOC of an empty pack stays at 0 %, or nearly",
}


def play_seed(seed: int) -> Played:
    return play(Script.of_seed(seed))


def campaign(seeds: Iterable[int], workers: int) -> list[Played]:
    """Every script; on one processor in this process, for debuggers."""
    if workers == 1:
        return [play_seed(seed) for seed in seeds]
    with multiprocessing.get_context("fork").Pool(workers) as pool:
        return pool.map(play_seed, seeds, chunksize=4)


def smallest(script: Script) -> Script:
    """The smallest script that breaks the same invariant."""
    wrong = kinds(play(script))
    plays = iter(range(SHRINK_PLAYS))
    return shrink(script, lambda smaller: next(plays, None) is not None and bool(kinds(play(smaller)) & wrong))


def kinds(played: Played) -> set[str]:
    """The broken invariants: "t = 1.00 s, bay 0, hot: …" is "hot"."""
    return {line.split(", ", 2)[2].split(":")[0] for line in played.violations}


def table(injected: Iterable[Injected]) -> list[str]:
    """The faults injected while the charger ran, and their outcome."""
    by_name: dict[str, list[Injected]] = defaultdict(list)
    for one in injected:
        by_name[one.name].append(one)
        by_name["all"].append(one)
    head = f"{'injected':22} {'times':>5} {'detected':>8} {'too short':>9} {'unseen':>6} {'verified':>8} {'named':>5}"
    names = (*sorted(set(by_name) - {"all"}), "all")
    return [f"{head}   stop after, s: median   p99    max", *(_row(name, by_name[name]) for name in names)]


def seen(one: Injected) -> bool:
    return bool(one.fault) or one.named


def unseen(one: Injected) -> bool:
    """It lasted long enough, the charger ran on, and nothing noticed."""
    return not (seen(one) or one.verified) and (one.lasted_s or 0.0) >= SHOWN_S


def _row(name: str, rows: list[Injected]) -> str:
    detected, missed = sum(map(seen, rows)), sum(map(unseen, rows))
    verified, named = sum(one.verified for one in rows), sum(one.named for one in rows)
    times_s = sorted(one.stop_s for one in rows if one.stop_s is not None and one.alone and one.fault)
    latency = "–"
    if times_s:
        p99_s = times_s[min(len(times_s) - 1, int(0.99 * len(times_s)))]
        latency = f"{statistics.median(times_s):6.3f} {p99_s:6.3f} {times_s[-1]:6.3f}"
    short = len(rows) - detected - missed
    row = f"{name:22} {len(rows):5} {detected:8} {short:9} {missed:6} {verified:8} {named:5}   {latency:>37}"
    return f"{row}   {WHY_UNSEEN.get(name, '')}" if missed else row


def main(argv: Sequence[str] | None = None) -> int:
    """Play, report and shrink failures; 1 if there were any."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scripts", type=int, default=1000, help="how many (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: %(default)s)")
    parser.add_argument("--seed", type=int, help="only this one")
    parser.add_argument("--script", type=Path, help="only the script in this file")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("-v", "--verbose", action="store_true")
    arguments = parser.parse_args(argv)
    began_s = time.monotonic()
    if arguments.script is not None:
        all_played = [play(Script.from_json(arguments.script.read_text(encoding="utf-8")))]
    elif arguments.seed is not None:
        all_played = [play_seed(arguments.seed)]
    else:
        all_played = campaign(range(arguments.first, arguments.first + arguments.scripts), arguments.workers)
    injected = [one for played in all_played for one in played.injected]
    if arguments.verbose:
        for one in injected:
            say(one)
    say("\n".join(table(injected)))
    failed = [played for played in all_played if played.violations]
    virtual_s = sum(played.script.end_s * len(played.script.bays) for played in all_played)
    say(
        f"{len(all_played)} scripts, {virtual_s / 3600:.1f} h of bays in {time.monotonic() - began_s:.0f} s; "
        f"{len(injected)} faults while a charger ran; {len(failed)} scripts failed"
    )
    why = [
        f"seed {played.script.seed}: nobody has seen {one}"
        for played in all_played for one in played.injected if unseen(one) and one.name not in WHY_UNSEEN
    ]  # fmt: skip
    say("\n".join(why)) if why else None
    for played in failed[:5]:
        say(f"\nseed {played.script.seed}:\n  " + "\n  ".join(played.violations))
        small = smallest(played.script)
        say("smallest script:\n" + small.to_json() + "\n  " + "\n  ".join(play(small).violations))
    return 1 if failed or why else 0


if __name__ == "__main__":
    sys.exit(main())
