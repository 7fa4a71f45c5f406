"""What no test can run is excluded from the measured coverage in its own line, with an excuse, and in no other way."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
EXCLUDES = re.compile(r"#.*pragma[: ]|# *nocover", re.IGNORECASE)
#: As in `# pragma: no cover - the kernel ends the process here`.
EXCUSED = re.compile(r"# pragma: no (cover|branch) - \w+( \S+){2,}$")


def test_an_excuse_stands_beside_each_exclusion() -> None:
    bare = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in sorted((ROOT / "orchestrator").rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if EXCLUDES.search(line) and not EXCUSED.search(line)
    ]
    assert bare == []


@pytest.mark.parametrize(
    ("line", "excused"),
    [
        ("    return 0  # pragma: no cover - the kernel ends the process here", True),
        ("    return 0  # pragma: no cover", False),
        ("    return 0  # pragma: no cover - rare", False),
        ("    return 0  # PRAGMA : NO COVER", False),
    ],
)
def test_what_is_no_excuse_is_seen(line: str, *, excused: bool) -> None:
    assert EXCLUDES.search(line)
    assert bool(EXCUSED.search(line)) is excused


def test_nothing_is_excluded_elsewhere() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        settings = tomllib.load(file)["tool"]["coverage"]
    assert settings["run"] == {"branch": True, "source": ["orchestrator"], "patch": ["subprocess"]}
    assert not {"exclude_also", "exclude_lines", "omit", "include", "partial_branches"} & set(settings["report"])
    assert not [name for name in (".coveragerc", "tox.ini", "setup.cfg") if (ROOT / name).exists()]


def test_ci_is_the_whole_check() -> None:
    steps = [
        line for line in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines() if line.startswith("make")
    ]
    assert steps == ["make lint", "make cover", "make test"]
