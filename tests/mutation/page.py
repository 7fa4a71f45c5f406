"""docs/mutation.md: the score of each module, and a table of the surviving mutants, with the reasons written there."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby

from tests.mutation.mutants import Mutant

GOAL_PCT = 98.5
Reasons = Mapping[tuple[str, str, str, str], str]

HEAD = """\
# Would a test notice?

`make mutation` breaks the product in every small way that [mutmut](https://mutmut.readthedocs.io) knows, one at a
time (a `<` to `<=`, an `and` to `or`, a number by one, an argument to None, a changed text), and runs the tests that
reach the broken function, the likeliest first. A mutant that no test notices survives: either a test is missing, or
the change has no effect. At least 98.5 % must be killed, and each survivor needs a reason below. Only the bodies of
functions and methods are mutated, not a module's tables and constants, nor functions with a decorator (a property,
for example).

`make mutation ARGS='orchestrator.protocol.frame.*'` tries some again. The command writes this page and keeps the
reasons; `?` marks a missing one. A mutant that times out counts as killed: it hung the test.
"""


def score(mutants: Sequence[Mutant]) -> float:
    """The share of tried mutants that were killed, in percent."""
    tried = [mutant for mutant in mutants if mutant.tried]
    return 100 * sum(not mutant.lives for mutant in tried) / max(1, len(tried))


def page(mutants: Sequence[Mutant], known: Reasons) -> str:
    """The whole page."""
    lines = [HEAD, *_scores(mutants), "", "## Survivors", "", *_living(mutants, known)]
    return "\n".join(lines) + "\n"


def _scores(mutants: Sequence[Mutant]) -> Iterator[str]:
    yield "| module | mutants | tried | killed | timed out | live | % killed | seconds |"
    yield "| --- | --: | --: | --: | --: | --: | --: | --: |"
    for module, some in groupby(mutants, lambda mutant: mutant.module):
        yield _score_row(f"`{module}`", list(some))
    yield _score_row("all", mutants)


def _score_row(title: str, mutants: Sequence[Mutant]) -> str:
    fates = (sum(getattr(mutant, fate) for mutant in mutants) for fate in ("tried", "killed", "timed_out", "lives"))
    seconds = sum(mutant.seconds for mutant in mutants)
    cells = (title, len(mutants), *fates, f"{score(mutants):.1f}", f"{seconds:.0f}")
    return f"| {' | '.join(map(str, cells))} |"


def _living(mutants: Iterable[Mutant], known: Reasons) -> Iterator[str]:
    yield "| module | function | was | became | why it survives |"
    yield "| --- | --- | --- | --- | --- |"
    for key in dict.fromkeys(mutant.key for mutant in mutants if mutant.lives):
        yield "| " + " | ".join([*(_code(cell) for cell in key), known.get(key, "?")]) + " |"


def _code(text: str) -> str:
    return f"`` {text} ``".replace("|", "\\|")


def reasons(text: str) -> Reasons:
    """The reasons that people wrote into the page."""
    rows = (re.split(r" (?<!\\)\| ", line[2:-2]) for line in text.splitlines() if line.startswith("| ``"))
    found = {tuple(cell[3:-3].replace("\\|", "|") for cell in cells[:4]): cells[4] for cells in rows}
    return {(key[0], key[1], key[2], key[3]): why for key, why in found.items() if why != "?"}
