"""The locked lists: exact, hashed, the same everywhere, and each a part of the next."""

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LISTS = ("runtime", "demo", "dev")

#: What a locked list consists of. Options, addresses and paths do not match.
LINE = re.compile(r"#.*|[a-z0-9-]+==[0-9][0-9a-z.]* \\|    --hash=sha256:[0-9a-f]{64}( \\)?|")


def lines(name: str) -> list[str]:
    return (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8").splitlines()


def pins(name: str) -> dict[str, str]:
    return dict(line.removesuffix(" \\").split("==") for line in lines(name) if "==" in line)


def names(requirements: Iterable[str]) -> set[str]:
    return {re.split(r"[<>=~! ]", text)[0].lower() for text in requirements}


@pytest.mark.parametrize("name", LISTS)
def test_a_list_has_versions_and_hashes_only(name: str) -> None:
    assert [line for line in lines(name) if not LINE.fullmatch(line)] == []
    assert [line for line in lines(name) if "/" in line] == []


@pytest.mark.parametrize("name", LISTS)
def test_every_version_has_a_hash(name: str) -> None:
    text = lines(name)
    pinned = [number for number, line in enumerate(text) if "==" in line]
    assert pinned
    assert [text[number] for number in pinned if "--hash=" not in text[number + 1]] == []


def test_each_list_is_a_part_of_the_next() -> None:
    runtime, demo, dev = (pins(name).items() for name in LISTS)
    assert runtime <= demo <= dev


def test_the_lists_have_all_that_is_asked_for() -> None:
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    built, project = asked["build-system"]["requires"], asked["project"]
    assert names(project["dependencies"]) | names(built) <= set(pins("runtime"))
    assert names(project["optional-dependencies"]["demo"]) <= set(pins("demo"))
    tools = (ROOT / "requirements" / "dev.in").read_text(encoding="utf-8").splitlines()
    assert names(line for line in tools if line[0] not in "#-") <= set(pins("dev"))
