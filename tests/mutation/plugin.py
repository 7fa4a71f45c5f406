"""How tests run differently on mutants: `pytest -p tests.mutation.plugin`, as called by mutmut.

- Hypothesis does not shrink failing examples, the slowest part by far, and tries the same examples for
  each mutant.
- The first failing test ends a mutant's trial. So the tests that ended recent trials come first, then the quick ones.
  In a first trial only the likeliest few run, in a second one, on the survivors, all: `TESTS` in the environment.
- Of the thousands that reach most functions only those run that run the changed statement (`lines.py`).
- Test ids are plain ASCII. mutmut collects repeatedly in one process, pytest escapes other characters in ids
  again each time and then finds no such test, and mutmut counts that as a killed mutant.
- A function with mutants runs directly during a trial, not through mutmut's trampoline, which looks up at each call
  which mutant is on trial: the core's tests would take three times as long.
- Where a test runs the product in a separate process, mutmut cannot see its coverage. A table lists it.
"""

import json
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache, update_wrapper
from inspect import isgeneratorfunction
from math import inf
from pathlib import Path
from types import FunctionType
from typing import Any

import _pytest.python as collecting
import pytest
from hypothesis import HealthCheck, Phase, settings
from mutmut.mutation import trampoline

from tests.mutation.lines import tests_of
from tests.mutation.mutants import FEW, TESTS

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

#: Test file → the modules that run in the process that its tests start.
ELSEWHERE: Mapping[str, Sequence[str]] = {
    **{
        f"tests/guardian/test_guardian{part}.py": ("orchestrator/lastresort/guardian.py",)
        for part in ("", "_messages", "_signals")
    },
    "tests/guardian/test_guardian_contactors.py": (
        "orchestrator/lastresort/guardian.py", "orchestrator/lastresort/contactors.py"
    ),
}  # fmt: skip
#: The likeliest tests: so many that ended recent trials, and that reach the fewest functions.
RECENT, CLOSEST = 60, 140
#: No quick test takes longer.
QUICK_S = 0.3
#: A longer one waits for something the mutant prevents.
HANGS_S = 20.0
STATS, KILLERS = Path("mutmut-stats.json"), Path("killers.txt")
#: Each function with mutants, by its module's name, and the mutants; mutmut's trampolines for them, in the same order.
STANDING: list[tuple[FunctionType, Mapping[str, FunctionType]]] = []
DETOURS: list[Callable[..., Any]] = []


def _wrap(mutants: Mapping[str, FunctionType], is_classmethod: bool = False) -> Callable[[Any], Any]:
    """Replaces mutmut's own: a plain function that uses the trampoline until `_stand` gives it a body."""
    detour_of = trampoline.wrap_in_trampoline_slowly(mutants, is_classmethod)

    def wrap(function: FunctionType) -> Any:
        detour = detour_of(function)
        if is_classmethod or function.__closure__ or isgeneratorfunction(function):
            return detour
        scope = function.__globals__
        scope["_mutation_detours"] = DETOURS
        made: dict[str, FunctionType] = {}
        exec(f"def f(*args, **kwargs): return _mutation_detours[{len(DETOURS)}](*args, **kwargs)", scope, made)
        standing = update_wrapper(made["f"], function)
        STANDING.append((made["f"], mutants))
        DETOURS.append(detour)
        return standing

    return wrap


def _on_trial() -> str:
    """The name of the mutant on trial in this process; "" while it only collects tests."""
    name = os.environ.get("MUTANT_UNDER_TEST", "")
    return name if "__mutmut_" in name else ""


def _stand(mutant: str) -> None:
    """Give each function its own body, and the mutated one the mutant's."""
    module, _, name = mutant.rpartition(".")
    for function, mutants in STANDING:
        chosen = mutants.get(name) if function.__module__ == module else None
        body = chosen or mutants["_mutmut_orig"]
        function.__code__, function.__defaults__, function.__kwdefaults__ = (
            body.__code__, body.__defaults__, body.__kwdefaults__,
        )  # fmt: skip


if not hasattr(trampoline, "wrap_in_trampoline_slowly"):
    trampoline.wrap_in_trampoline_slowly = trampoline.wrap_in_trampoline
    trampoline.wrap_in_trampoline = _wrap


@cache
def _seconds() -> Mapping[str, float]:
    """Of each test, with mutmut's trampolines in the code."""
    seconds: dict[str, float] = _stats()["duration_by_test"]
    return seconds


@cache
def _reach() -> Mapping[str, int]:
    """How many functions with mutants each test reaches."""
    return Counter(test for tests in _stats()["tests_by_mangled_function_name"].values() for test in tests)


def _stats() -> dict[str, Any]:
    if not STATS.exists():
        return {"duration_by_test": {}, "tests_by_mangled_function_name": {}}
    return json.loads(STATS.read_text(encoding="utf-8"))  # type: ignore[no-any-return]  # mutmut's own file


def _ago() -> Mapping[str, int]:
    """Each test that ended a trial, the most recent first, with its number."""
    names = KILLERS.read_text(encoding="utf-8").splitlines() if KILLERS.exists() else []
    return {name: number for number, name in enumerate(dict.fromkeys(reversed(names)))}


def pytest_configure(config: pytest.Config) -> None:
    """Before anything is collected: the likeliest few of the tests that reach the mutant."""
    if not _on_trial():
        for known in (_seconds, _reach):  # by the processes of the trials, which are forked from this one
            known.cache_clear()
            known()
        return
    if running := _that_run(_on_trial()):
        elsewhere = {file for file, modules in ELSEWHERE.items() if _module(_on_trial()) in modules}
        config.args[:] = [
            name for name in config.args if name in running or name.partition("::")[0] in elsewhere
        ] or config.args
    if os.environ[TESTS] == FEW:
        config.args[:] = _likeliest(config.args)


def _likeliest(names: Sequence[str]) -> list[str]:
    ago, reach, seconds = _ago(), _reach(), _seconds()
    recent = sorted((name for name in names if name in ago), key=ago.__getitem__)[:RECENT]
    quick = [name for name in names if seconds.get(name, 0.0) <= QUICK_S] or names
    closest = sorted(quick, key=lambda name: (reach.get(name, 0), seconds.get(name, 0.0)))[:CLOSEST]
    return list(dict.fromkeys([*recent, *closest]))


def _that_run(mutant: str) -> Collection[str]:
    """The tests that run its statement; empty if that is not known."""
    module, _, name = mutant.rpartition(".")
    for function, mutants in STANDING:
        if function.__module__ == module and name in mutants:
            return tests_of(function, mutants["_mutmut_orig"], mutants[name])
    return ()


def _module(mutant: str) -> str:
    return f"{mutant.rpartition('.')[0].replace('.', '/')}.py"


def pytest_sessionstart() -> None:
    if mutant := _on_trial():
        _stand(mutant)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if not _on_trial():
        return
    ago, seconds = _ago(), _seconds()
    for item in items:
        item.add_marker(pytest.mark.timeout(HANGS_S), append=False)
    items.sort(key=lambda item: (ago.get(item.nodeid, inf), seconds.get(item.nodeid, 0.0)))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.failed and _on_trial():
        with KILLERS.open("a", encoding="utf-8") as file:
            file.write(f"{report.nodeid}\n")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    for module in ELSEWHERE.get(item.nodeid.partition("::")[0], ()):
        if os.environ.get("MUTANT_UNDER_TEST") == "stats":
            from mutmut.state import state  # only mutmut itself sets that variable

            mutants = json.loads(Path(f"{module}.meta").read_text(encoding="utf-8"))["exit_code_by_key"]
            state()._stats |= {name.rpartition("__mutmut_")[0] for name in mutants}
