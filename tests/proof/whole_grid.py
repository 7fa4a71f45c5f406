"""The grid in its long form: every state × every row × each of the line's three activities, and the table rows used.

python -m tests.proof.whole_grid
"""

import argparse
import multiprocessing
import os
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence

from orchestrator.core.faults import FAULTS
from orchestrator.interlock import ALLOWED
from orchestrator.model import Action, ControlMode, State
from tests.proof.exploring import changes_of_table
from tests.proof.grid import STOP_WITHIN_S, Cell, Ended, Phase, Used, cells, commands, play
from tests.proof.paths import NEVER_MADE, PATHS
from tests.proof.play import play as play_script
from tests.proof.report import say

Order = tuple[Action, int]
#: Allowed by the interlock, commanded by no run, and why.
NEVER_ORDERED: dict[Order, str] = {(Action.SET_MODE, 5): "no policy has a use for mode 5: a charge ends by a stop"}
#: Station limits that each make another current step the highest; and the SOC of the charge.
CHARGES = ((15.0, None), *((limit_a, 50.0) for limit_a in (2.0, 5.0, 8.0, 11.0, 14.0)))


def orders_allowed() -> set[Order]:
    """The interlock's list; a stop needs no entry."""
    return {(action, value) for action, values in ALLOWED[ControlMode.MANUAL].items() for value in values}


def orders_let_out() -> set[Order]:
    """The commands used in charges under every limit."""
    let_out: set[Order] = set()
    for limit_a, soc_pct in CHARGES:
        let_out |= commands(limit_a, soc_pct)
    return let_out - {(Action.STOP, 0)}


def played(cell: Cell) -> tuple[Ended, Used]:
    used = Used()
    return play(cell, used), used


def table(chosen: Sequence[Cell], ended: Sequence[Ended]) -> Iterator[str]:
    """By state, the results of its cells; by phase, the time of a stop."""
    words = sorted({one.word for one in ended})
    yield f"{'state':21}" + "".join(f"{word:>28}" for word in words)
    for state in State:
        counted = Counter(one.word for cell, one in zip(chosen, ended, strict=True) if cell.state is state)
        yield f"{state:21}" + "".join(f"{counted[word]:28}" for word in words)
    yield f"{'all':21}" + "".join(f"{sum(one.word == word for one in ended):28}" for word in words)
    for phase in Phase:
        stops_s = sorted(
            one.stop_s for cell, one in zip(chosen, ended, strict=True)
            if cell.phase is phase and cell.row.for_s == 0 and cell.row.polls == 1 and one.stop_s is not None
        )  # fmt: skip
        if stops_s:
            yield (
                f"{phase:21} {len(stops_s):4} stops, from the step that orders one to its first byte: median "
                f"{statistics.median(stops_s) * 1000:.1f} ms, max {stops_s[-1] * 1000:.1f} ms, allowed "
                f"{STOP_WITHIN_S[phase] * 1000:.0f} ms"
            )


def unused(used: Used) -> tuple[list[str], bool]:
    """What no run used, and why; True if something has no reason."""
    rows = {row.id for row in FAULTS}
    changes, allowed, let_out = changes_of_table(), orders_allowed(), orders_let_out()
    made = used.changes
    said = [
        f"rows of the fault table raised: {len(used.rows)} of {len(rows)}",
        f"changes of state made: {len(made & changes)} of {len(changes)}; others: {len(made - changes)}",
        f"orders of the interlock's list let out: {len(let_out & allowed)} of {len(allowed)}",
    ]
    said += [f"  not raised: {name}" for name in sorted(rows - used.rows)]
    said += [f"  not made: {a} → {b}: {NEVER_MADE.get((a, b), 'WHY?')}" for a, b in sorted(changes - made)]
    said += [
        f"  not let out: {action} {value}: {NEVER_ORDERED.get((action, value), 'WHY?')}"
        for action, value in sorted(allowed - let_out)
    ]
    idle = rows - used.rows or changes - made - set(NEVER_MADE) or allowed - let_out - set(NEVER_ORDERED)
    return said, bool(idle or made - changes or let_out - allowed)


def main(argv: Sequence[str] | None = None) -> int:
    """The whole grid and a table; 1 if a cell ended badly or something was unused without a reason."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args(argv)
    began_s = time.monotonic()
    chosen = list(cells(lambda _: tuple(Phase)))
    used = Used()
    with multiprocessing.get_context("fork").Pool(arguments.workers) as pool:
        results = pool.map(played, chosen, chunksize=8)
        paths = dict(zip(PATHS, pool.map(play_script, PATHS.values()), strict=True))
    for _, seen in results:
        used.rows |= seen.rows
        used.changes |= seen.changes
    wrong = [f"{cell}: {'; '.join(one.wrong)}" for cell, (one, _) in zip(chosen, results, strict=True) if one.wrong]
    for name, script in paths.items():
        used.changes |= script.changes
        wrong += [f"{name}: {line}" for line in script.violations]
    say("\n".join(table(chosen, [one for one, _ in results])))
    said, idle = unused(used)
    say("\n".join(said))
    took_s = time.monotonic() - began_s
    say(f"{len(chosen)} cells and {len(paths)} paths in {took_s:.0f} s; {len(wrong)} ended badly")
    say("\n".join(wrong[:20])) if wrong else None
    return 1 if wrong or idle else 0


if __name__ == "__main__":
    sys.exit(main())
