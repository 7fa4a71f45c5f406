"""What the tests do otherwise while they try mutants: `pytest -p tests.mutation.plugin`, as mutmut calls it.

- Hypothesis does not shrink an example that fails, which takes longer than all else, and tries the same examples for
  each mutant.
- The first test that fails ends a mutant's trial. So those come first that ended the last ones, then the quick ones.
  Slow tests have a trial of their own, of the mutants that lived: `SLOW_TESTS` in the environment.
- A test's id is plain ASCII. mutmut collects again and again in one process, pytest escapes an id's other characters
  anew each time, and then finds no such test; what mutmut makes of that is a mutant that was killed.
- Where a test runs the product in a process of its own, mutmut cannot see what it reaches. A table says it.
"""

import json
import os
import re
from collections.abc import Mapping
from math import inf
from pathlib import Path

import _pytest.python as collecting
import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.mutation.mutants import SLOW_TESTS

settings.register_profile(
    "mutation",
    phases=(Phase.explicit, Phase.generate),
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=(HealthCheck.too_slow,),
)
settings.load_profile("mutation")


def _plain(val: str | bytes, config: pytest.Config | None) -> str:
    return re.sub("[^ -~]", "?", val if isinstance(val, str) else val.hex())


collecting._ascii_escaped_by_config = _plain

#: File of tests → the module that they start as a process.
ELSEWHERE: Mapping[str, str] = {"tests/guardian/test_guardian.py": "orchestrator/service/guardian.py"}
#: What takes longer is a slow test, measured with mutmut's detours in the code.
QUICK_S = 0.3
STATS, KILLERS = Path("mutmut-stats.json"), Path("killers.txt")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    seconds = json.loads(STATS.read_text(encoding="utf-8"))["duration_by_test"] if STATS.exists() else {}
    names = KILLERS.read_text(encoding="utf-8").splitlines() if KILLERS.exists() else []
    ago = {name: number for number, name in enumerate(dict.fromkeys(reversed(names)))}
    slow = SLOW_TESTS in os.environ
    chosen = [item for item in items if (seconds.get(item.nodeid, 0.0) > QUICK_S) == slow] or items
    items[:] = sorted(chosen, key=lambda item: (ago.get(item.nodeid, inf), seconds.get(item.nodeid, 0.0)))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.failed and "__mutmut_" in os.environ.get("MUTANT_UNDER_TEST", ""):
        with KILLERS.open("a", encoding="utf-8") as file:
            file.write(f"{report.nodeid}\n")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    module = ELSEWHERE.get(item.nodeid.partition("::")[0])
    if module and os.environ.get("MUTANT_UNDER_TEST") == "stats":
        from mutmut.state import state  # only mutmut itself sets that variable

        mutants = json.loads(Path(f"{module}.meta").read_text(encoding="utf-8"))["exit_code_by_key"]
        state()._stats |= {name.rpartition("__mutmut_")[0] for name in mutants}
