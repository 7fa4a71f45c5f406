"""The page is self-contained and complete, and escapes all text."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image

from orchestrator.config.load import load_policy
from orchestrator.errors import OrchestratorError
from orchestrator.workbench.draw.present import save
from orchestrator.workbench.simulate.simulation import Run, simulate
from tests.workbench.scenarios import scenario

#: Tags without an end tag.
VOID = {"meta", "br"}


class Tags(HTMLParser):
    """Checks that every tag is closed, and collects the text outside scripts and styles."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "xlink:href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("script", "style"):
            self.text += data


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    what_happens = scenario(0.6, scenario="half-an-hour", about="one small <battery> & nothing else")
    return [simulate(load_policy(name), what_happens) for name in ("li-ion-48v", "long-life-48v")]


@pytest.fixture(scope="module")
def files(runs: list[Run], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return save(runs, tmp_path_factory.mktemp("out") / "new")


def parsed(path: Path) -> Tags:
    tags = Tags()
    tags.feed(path.read_text(encoding="utf-8"))
    return tags


def test_a_page_and_a_picture_are_written(files: list[Path]) -> None:
    assert [path.name for path in files] == ["half-an-hour.html", "half-an-hour.png"]
    with Image.open(files[1]) as picture:
        assert (picture.format, picture.width) == ("PNG", 1560)
        assert len(picture.getcolors(1 << 24) or ()) > 50


def test_the_page_is_whole_and_needs_nothing_from_elsewhere(files: list[Path]) -> None:
    tags = parsed(files[0])
    assert tags.open == []
    assert all(address.startswith("#") for address in tags.addresses)
    assert files[0].stat().st_size < 300_000


def test_the_page_names_figures_rules_and_their_lines(files: list[Path], runs: list[Run]) -> None:
    text = " ".join(parsed(files[0]).text.split())
    assert "one small <battery> & nothing else" in text
    for run in runs:
        assert run.policy.source.file in text
        for span in run.trail.spans:
            assert re.sub(r"\s+", " ", span.why)[:30] in text
    assert "time to full, h:min" in text
    assert "SOC 90 % in 90 … 100 allows 8.0 A, policies/li-ion-48v.yaml:60" in text
    assert "policies/long-life-48v.yaml:50" in text


def test_what_the_policies_do_differently_is_marked(files: list[Path]) -> None:
    assert '<tr class="differs"><td>time to full, h:min</td>' in files[0].read_text(encoding="utf-8")


def test_a_place_that_cannot_be_written_is_named(runs: list[Run], tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(
        OrchestratorError, match=r"file/half-an-hour.html cannot be written: Not a directory|File exists"
    ):
        save(runs, tmp_path / "file")


def test_one_policy_alone_has_no_differences(runs: list[Run], tmp_path: Path) -> None:
    page, _ = save([replace(runs[0])], tmp_path)
    assert 'class="differs"' not in page.read_text(encoding="utf-8")
