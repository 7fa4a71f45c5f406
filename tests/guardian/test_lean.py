"""Imports of the last-resort processes, direct and indirect: the standard library and little of ours."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.guardian.chargers import running_chargers
from tests.sources import PACKAGE, ROOT, Module, product

ROOM = {"", "lastresort"}
PORT = ROOM | {f"lastresort.{name}" for name in ("port_owner", "line_settings", "bareport")}
LAST_PORT = PORT | {"protocol", "protocol.standby", "lastresort.lastport"}
LINE = LAST_PORT | {"lastresort.descriptors", "lastresort.lastline"}
STOP = LINE | {"lastresort.laststop"}
ALONE = ("port_owner", "line_settings", "notify", "lastopen", "descriptors", "contactors", "estop_options", "terminal")
#: Module → all product modules imported with it.
LEAN: dict[str, set[str]] = {
    "protocol.standby": {"", "protocol", "protocol.standby"},
    **{f"lastresort.{name}": ROOM | {f"lastresort.{name}"} for name in ALONE},
    "lastresort.unheld": STOP | {"lastresort.notify", "lastresort.unheld"},
    "lastresort.bareport": PORT,
    "lastresort.lastport": LAST_PORT,
    "lastresort.lastline": LINE,
    "lastresort.laststop": STOP,
    "lastresort.estop": STOP | {f"lastresort.{name}" for name in ("contactors", "estop_options", "estop")},
    "lastresort.guardian": STOP
    | {f"lastresort.{name}" for name in ("contactors", "lastopen", "notify", "terminal", "unheld", "guardian")},
}
MODULES = {module.name: module for module in product()}


def at_import(module: Module) -> Iterator[str]:
    """The module's import-time imports, without those its functions make when called."""
    body = ast.parse(module.source).body
    for top in body:
        within = [top] if isinstance(top, ast.Import | ast.ImportFrom) else []
        if isinstance(top, ast.If | ast.Try | ast.With):
            within = [node for node in ast.walk(top) if isinstance(node, ast.Import | ast.ImportFrom)]
        for node in within:
            if isinstance(node, ast.Import):
                yield from (alias.name for alias in node.names)
            else:
                yield from (f"{node.module}.{alias.name}" for alias in node.names)


def closure(name: str) -> tuple[set[str], set[str]]:
    """All product modules and all other libraries imported with this one."""
    ours: set[str] = set()
    others: set[str] = set()
    waiting = [name]
    while waiting:
        name = waiting.pop()
        if name in ours:
            continue
        ours.add(name)
        if name:
            waiting.append(name.rpartition(".")[0])
        for imported in at_import(MODULES[name]):
            package, _, target = imported.partition(".")
            if package != PACKAGE:
                others.add(package)
            elif target in MODULES:
                waiting.append(target)
            elif target.rpartition(".")[0] in MODULES:
                waiting.append(target.rpartition(".")[0])
    return ours, others


@pytest.mark.parametrize("name", LEAN)
def test_all_that_comes_in_is_the_standard_library_and_what_is_listed(name: str) -> None:
    ours, others = closure(name)
    assert ours == LEAN[name]
    assert others <= sys.stdlib_module_names


@pytest.mark.parametrize("name", LEAN)
def test_it_is_imported_where_no_other_library_exists(name: str) -> None:
    program = f"import sys, {PACKAGE}.{name}; print(*sorted(n for n in sys.modules if n.startswith('{PACKAGE}')))"
    done = subprocess.run(
        [sys.executable, "-S", "-c", program], cwd=ROOT.parent, capture_output=True, text=True, check=True, timeout=30
    )
    assert {module.removeprefix(PACKAGE).removeprefix(".") for module in done.stdout.split()} == LEAN[name]


def test_an_emergency_stop_needs_no_other_library(tmp_path: Path) -> None:
    """A complete run, with the service it looks for."""
    with running_chargers(tmp_path) as (bench,):
        argv = [sys.executable, "-S", "-m", PACKAGE, "estop", "--port", bench.name]
        done = subprocess.run(argv, cwd=ROOT.parent, capture_output=True, text=True, check=False, timeout=30)
        assert (done.returncode, done.stdout) == (
            0, f"{bench.name}: standby verified\nevery charger stands by, verified\n",
        )  # fmt: skip


def test_an_import_that_is_not_listed_is_seen() -> None:
    spoilt = Module("lastresort.notify", "import os\ntry:\n    import yaml\nexcept ImportError:\n    import json\n")
    assert list(at_import(spoilt)) == ["os", "yaml", "json"]
    assert list(at_import(Module("lastresort.notify", "def f():\n    import yaml\n"))) == []
