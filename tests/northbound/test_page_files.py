"""The files of the page: words in both languages, what the first state costs, and what its security policy allows."""

import gzip
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from orchestrator.model import State

STATIC = Path(__file__).parents[2] / "orchestrator" / "northbound" / "static"
SCRIPTS = {path.name: path.read_text(encoding="utf-8") for path in sorted(STATIC.glob("*.js"))}
PAGE, STYLE, INDEX = SCRIPTS["page.js"], (STATIC / "page.css").read_text(), (STATIC / "index.html").read_text()
#: A row of the table of words. A text may stand on lines of its own.
ROW = re.compile(r'^  (\w+): \[\s*("(?:[^"\\]|\\.)*"),\s*("(?:[^"\\]|\\.)*"),?\s*\],$', re.MULTILINE)
WORDS = {
    key: (json.loads(english), json.loads(korean))
    for key, english, korean in ROW.findall(PAGE.partition("export const WORDS = {")[2].partition("\n};")[0])
}
MOST_BYTES, MOST_REQUESTS = 100_000, 4
#: Without a Korean word: abbreviations.
ALIKE = {"soh_bmu"}


def packed(*paths: Path) -> int:
    return sum(len(gzip.compress(path.read_bytes())) for path in paths)


def test_every_word_stands_in_both_languages() -> None:
    table = PAGE.partition("export const WORDS = {")[2].partition("\n};")[0]
    assert len(WORDS) == len(re.findall(r"^  \w+: \[", table, re.MULTILINE)) > 100
    for key, (english, korean) in WORDS.items():
        assert english, key
        assert sorted(re.findall(r"\{\w+\}", english)) == sorted(re.findall(r"\{\w+\}", korean)), key
        if key != "language":
            assert not re.search("[가-힣]", english), key
            assert re.search("[가-힣]", korean) or key in ALIKE, key


def test_every_word_that_a_view_uses_is_there_and_each_one_is_used() -> None:
    code = "\n".join(SCRIPTS.values())
    code = code.replace(PAGE.partition("export const WORDS = {")[2].partition("\n};")[0], "")
    used = set(re.findall(r'\b(?:word|section|card)\("(\w+)"', code))
    assert used <= WORDS.keys()
    named = set(re.findall(r'"(\w+)"|\b(\w+):|`(\w+?)_', code)) | {(state.value, "", "") for state in State}
    mentioned = {part for group in named for part in group}
    unused = {key for key in WORDS if key not in mentioned and not key.endswith("_does")}
    assert not unused


def test_every_state_has_a_word_and_a_shape() -> None:
    shapes = PAGE.partition("const STATES = {")[2].partition("};")[0]
    for state in State:
        assert state.value in WORDS
        assert f"{state.value}: [" in shapes


def test_the_first_state_costs_little() -> None:
    first = [STATIC / name for name in ("index.html", "page.css", "page.js", "icon.svg")]
    assert packed(*first) < MOST_BYTES / 3
    everything = [path for path in STATIC.rglob("*") if path.suffix in {".html", ".css", ".js", ".svg"}]
    assert packed(*everything) < MOST_BYTES
    asked = [
        "index.html",
        *re.findall(r'<(?:script|link rel="stylesheet")[^>]*(?:src|href)="([^"]+)"', INDEX),
        "the stream",
    ]
    assert len(asked) <= MOST_REQUESTS
    assert not re.findall(r"^import ", PAGE, re.MULTILINE)  # one more request each
    assert "@import" not in STYLE
    assert "url(" not in STYLE


class Inline(HTMLParser):
    """What a page may not have under `default-src 'self'`."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag == "style" or (tag == "script" and not given.get("src")):
            self.found.append(tag)
        self.found += [name for name in given if name == "style" or name.startswith("on")]
        self.found += [value for name, value in given.items() if name in {"src", "href"} and value and value[:1] != "/"]


def test_nothing_is_inline_and_nothing_comes_from_elsewhere() -> None:
    looked = Inline()
    looked.feed(INDEX)
    assert looked.found == []
    for name, script in SCRIPTS.items():
        forbidden = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|style: |\"style\""
        assert not re.findall(forbidden, script), name
        assert set(re.findall(r"https?://[^\s\"'`]+", script)) <= {"http://www.w3.org/2000/svg"}, name


@pytest.mark.parametrize("name", sorted(path.name for path in (STATIC / "vendor").glob("*.js")))
def test_what_is_not_ours_names_its_version_and_has_its_licence(name: str) -> None:
    match = re.fullmatch(r"([a-z-]+)-(\d+\.\d+\.\d+)(\.min)?\.js", name)
    assert match
    licence = (STATIC / "vendor" / f"{match[1]}-{match[2]}.LICENSE").read_text()
    assert "Permission is hereby granted, free of charge" in licence
    if match[1] == "uplot":
        assert f"(v{match[2]})" in (STATIC / "vendor" / name).read_text()[:200]
