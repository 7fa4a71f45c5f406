"""The locked lists: exact, hashed, the same everywhere, and all contained in dev, except the lists for one command."""

import re
import tomllib
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
#: runtime is part of every other list, and all are part of dev.
LISTS = ("runtime", "completion", "demo", "gpio", "web", "workbench", "dev")
EXTRAS = ("completion", "demo", "gpio", "web", "workbench")
OWN = ("fuzz", "mutation", "reference")  #: needed only by their own command
ALL = (*LISTS, *OWN)

#: The lines of a locked list. Options, addresses and paths do not match.
LINE = re.compile(r"#.*|[a-z0-9-]+(\[[a-z0-9,-]+\])?==[0-9][0-9a-z.]* \\|    --hash=sha256:[0-9a-f]{64}( \\)?|")


def lines(name: str) -> list[str]:
    return (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8").splitlines()


def pins(name: str) -> dict[str, str]:
    return {plain: version for plain, _, version in pinned(name)}


def pinned(name: str) -> list[tuple[str, set[str], str]]:
    """Name, extras and version of everything on a list."""
    found = [re.split(r"[][]+|==", line.removesuffix(" \\")) for line in lines(name) if "==" in line]
    return [(plain, set(extras[0].split(",")) if extras else set(), version) for plain, *extras, version in found]


def names(requirements: Iterable[str]) -> set[str]:
    return {re.split(r"[<>=~! ]", text)[0].lower() for text in requirements}


@pytest.mark.parametrize("name", ALL)
def test_a_list_has_versions_and_hashes_only(name: str) -> None:
    assert [line for line in lines(name) if not LINE.fullmatch(line)] == []
    assert [line for line in lines(name) if "/" in line] == []


@pytest.mark.parametrize("name", ALL)
def test_every_version_has_a_hash(name: str) -> None:
    text = lines(name)
    numbers = [number for number, line in enumerate(text) if "==" in line]
    assert numbers
    assert [text[number] for number in numbers if "--hash=" not in text[number + 1]] == []


def test_each_list_is_a_part_of_the_next() -> None:
    runtime, *extras, dev = (pins(name).items() for name in LISTS)
    assert all(runtime <= extra <= dev for extra in extras)


def test_the_lists_have_all_that_is_asked_for() -> None:
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    built, project = asked["build-system"]["requires"], asked["project"]
    assert names(project["dependencies"]) | names(built) <= set(pins("runtime"))
    for extra in EXTRAS:
        assert names(project["optional-dependencies"][extra]) <= set(pins(extra))
    for tools in ("dev", *OWN):
        lines_in = (ROOT / "requirements" / f"{tools}.in").read_text(encoding="utf-8").splitlines()
        assert names(line for line in lines_in if line[0] not in "#-") <= set(pins(tools))


def test_what_is_asked_for_with_an_extra_is_pinned_with_it() -> None:
    """pip 23 does not match a pin without its extra: at the next release it wants that version, and its hash."""
    extras = {plain: extras for plain, extras, _ in pinned("dev")}
    asked = [Requirement(text) for plain in extras for text in metadata.requires(plain) or ()]
    needed = {one.name: one.extras for one in asked if one.extras and (one.marker is None or one.marker.evaluate())}
    assert needed, "pytest-cov asks for coverage[toml]"
    assert {name: wanted for name, wanted in needed.items() if not wanted <= extras[name]} == {}
