"""`pytest -p tests.mutation.lines`: notes which tests run which lines, in LINES.

A mutant of a line needs only the tests that run it, a few of the thousands that reach most functions.
"""

import ast
import inspect
import json
from collections.abc import Collection, Iterator
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest
from coverage import Coverage

ROOT = Path(__file__).resolve().parents[2]
#: mutmut's directory, in which it runs the tests.
MUTANTS = "mutants"
LINES = "lines.json"
MUTATED = ("orchestrator/core/*", "orchestrator/interlock.py", "orchestrator/protocol/*", "orchestrator/lastresort/*")

coverage = Coverage(data_file=None, config_file=False, include=[str(ROOT / one) for one in MUTATED])


def pytest_configure() -> None:
    coverage.start()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    coverage.switch_context(item.nodeid)
    return (yield)


def pytest_unconfigure() -> None:
    """The tests by module and line: {"orchestrator/core/decide.py": {"53": [0, 17]}, …}, numbers in "tests"."""
    coverage.stop()
    data = coverage.get_data()
    numbers = {name: number for number, name in enumerate(sorted(data.measured_contexts()))}
    found: dict[str, object] = {"tests": list(numbers)}
    for file in sorted(data.measured_files()):
        lines = data.contexts_by_lineno(file)
        found[str(Path(file).relative_to(ROOT))] = {
            str(line): sorted(numbers[name] for name in names) for line, names in sorted(lines.items())
        }
    (ROOT / MUTANTS / LINES).write_text(json.dumps(found), encoding="utf-8")


def tests_of(function: FunctionType, original: FunctionType, mutant: FunctionType) -> Collection[str]:
    """The tests that run the mutated statement of a function; empty if that is not known.

    `original` and `mutant` are mutmut's copies of its body.
    """
    file = f"{function.__module__.replace('.', '/')}.py"
    lines = _lines().get(file)
    if lines is None:
        return ()
    number = _first_difference(original, mutant)
    span = _statement(Path("..", file), function.__qualname__, number)
    names = _lines()["tests"]
    return {names[test] for line in span for test in lines.get(str(line), ())}


@cache
def _lines() -> dict[str, Any]:
    path = Path(LINES)
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _first_difference(original: FunctionType, mutant: FunctionType) -> int:
    """The first line that differs, counted from that with the `def`."""
    one, other = (inspect.getsource(function).replace(function.__name__, "") for function in (original, mutant))
    pairs = zip(one.splitlines(), other.splitlines(), strict=False)
    return next((number for number, (was, became) in enumerate(pairs) if was != became), 0)


def _statement(file: Path, qualname: str, number: int) -> range:
    """The lines of the innermost statement there; of one with a body, its head. All of the function for its `def`."""
    node: ast.AST = ast.parse(file.read_text(encoding="utf-8"))
    for name in qualname.split("."):
        node = next(one for one in ast.iter_child_nodes(node) if getattr(one, "name", "") == name)
    assert isinstance(node, ast.FunctionDef)
    line = node.lineno + number
    inside = [
        one for one in ast.walk(node) if isinstance(one, ast.stmt) and one.lineno <= line <= (one.end_lineno or 0)
    ]
    innermost = max(inside, key=lambda one: one.lineno)
    body = getattr(innermost, "body", None)
    return _span(innermost) if innermost is node or not body else range(innermost.lineno, body[0].lineno)


def _span(statement: ast.stmt) -> range:
    return range(statement.lineno, (statement.end_lineno or statement.lineno) + 1)
