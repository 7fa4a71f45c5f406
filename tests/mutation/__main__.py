"""Break the product in every small way, one at a time, and check that a test notices: `python -m tests.mutation`.

mutmut makes and tries the mutants; pyproject.toml sets the modules and tests. The results go to docs/mutation.md, where
people write the reasons for survivors. Arguments select mutants, such as `orchestrator.protocol.frame.*`; the default
is new mutants and those of changed functions. Each is tried with a few likely tests of those that run the changed
statement; survivors without a reason are tried again with all of these.
"""

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from tests.mutation.mutants import ALL, FEW, TESTS, Mutant
from tests.mutation.page import GOAL_PCT, Reasons, page, reasons, score

ROOT = Path(__file__).resolve().parent.parent.parent
MUTANTS = ROOT / "mutants"
PAGE = ROOT / "docs" / "mutation.md"


def main(patterns: Sequence[str]) -> int:
    """Try them and write the page; 1 if too many survive, one survives without a reason, or some were not tried."""
    known = reasons(PAGE.read_text(encoding="utf-8")) if PAGE.exists() else {}
    _note_lines()
    os.environ[TESTS] = FEW
    _mutmut("run", "--max-children", "1", *patterns)
    if living := [mutant.name for mutant in _unexplained(_mutants(), known)]:
        os.environ[TESTS] = ALL
        _mutmut("run", "--max-children", "1", *living)
    mutants = list(_mutants())
    PAGE.write_text(page(mutants, known), encoding="utf-8")
    unexplained = _unexplained(mutants, known)
    for mutant in unexplained:
        print(f"no reason in {PAGE.name}: {mutant.key}")
    untried = sum(not mutant.tried for mutant in mutants)
    print(
        f"{score(mutants):.1f} % of {len(mutants) - untried} mutants killed; {len(unexplained)} live without a reason; "
        f"{untried} not tried"
    )
    return int(score(mutants) < GOAL_PCT or bool(unexplained or untried))


def _note_lines() -> None:
    """Run the tests once without mutants, to see which lines each of them runs."""
    chosen = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mutmut"]
    options = [*chosen["pytest_add_cli_args"], *chosen["pytest_add_cli_args_test_selection"]]
    MUTANTS.mkdir(exist_ok=True)
    subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "tests.mutation.lines", *options], cwd=ROOT, check=True)


def _unexplained(mutants: Iterable[Mutant], known: Reasons) -> list[Mutant]:
    return [mutant for mutant in mutants if mutant.lives and mutant.key not in known]


def _mutants() -> Iterator[Mutant]:
    """All mutants tried, by module and in source order."""
    for file in sorted(MUTANTS.rglob("*.py.meta")):
        module = str(file.relative_to(MUTANTS)).removesuffix(".meta")
        meta = json.loads(file.read_text(encoding="utf-8"))
        for name, code in meta["exit_code_by_key"].items():
            mutant = Mutant(module, name, code, meta["durations_by_key"].get(name, 0.0))
            yield mutant.shown(_mutmut("show", name)) if mutant.lives else mutant


def _mutmut(*arguments: str) -> str:
    """Its output, of `run` on the terminal."""
    command = [str(Path(sys.executable).with_name("mutmut")), *arguments]
    done = subprocess.run(command, cwd=ROOT, check=True, text=True, stdout=None if "run" in arguments else -1)
    return done.stdout or ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
