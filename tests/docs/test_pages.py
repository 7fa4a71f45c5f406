"""Generated pages match the code."""

import re
from pathlib import Path

from orchestrator.cli import _parser
from orchestrator.config.load import load_policy
from orchestrator.config.shipped import shipped_names
from orchestrator.core.faults import FAULTS
from orchestrator.text.catalogue import LANGUAGES
from orchestrator.workbench.draw.diagram import diagram, mermaid
from tests.docs import cause_page, operating_page, status_page
from tests.docs.catalogue import CATALOGUE
from tests.docs.fault_page import page, rows_of

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def test_the_page_of_faults_is_the_table() -> None:
    written = (DOCS / "faults.md").read_text(encoding="utf-8")
    assert written == page(), "python -m tests.docs.fault_page > docs/faults.md"


def test_the_page_of_causes_is_the_catalogue() -> None:
    written = (DOCS / "causes.md").read_text(encoding="utf-8")
    assert written == cause_page.page(), "python -m tests.docs.cause_page > docs/causes.md"


def test_the_page_of_the_status_is_its_records() -> None:
    written = (DOCS / "status.md").read_text(encoding="utf-8")
    assert written == status_page.page(), "python -m tests.docs.status_page > docs/status.md"


def test_the_picture_in_the_readme_is_the_machine() -> None:
    written = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"```mermaid\n{mermaid(diagram())}```" in written, "orchestrator diagram"


def test_each_command_of_the_operating_page_is_one() -> None:
    written = (DOCS / "operating.md").read_text(encoding="utf-8")
    commands = re.findall(r"^\$ orchestrator (.+)$", written, re.MULTILINE)
    answers = [*operating_page.ANSWERS, operating_page.MANY, operating_page.PAUSE, *operating_page.BATTERIES]
    assert commands == [one.command for one in answers]
    for command in commands:
        assert _parser().parse_args(command.split())


#: The numbers of the catalogue.
NUMBERS = [
    *(f"C{number}" for number in range(1, 32)),
    *(f"B{number}" for number in range(1, 29)),
    *(f"G{number}" for number in range(1, 12)),
    *(f"P{number}" for number in range(1, 13)),
]


def test_every_number_of_the_catalogue_is_handled_somewhere() -> None:
    assert [entry.number for entry in CATALOGUE] == NUMBERS
    nowhere = [entry.number for entry in CATALOGUE if not rows_of(entry.number) and not entry.also]
    assert nowhere == []


def test_every_row_comes_from_the_catalogue() -> None:
    assert {number for row in FAULTS for number in row.source.split(", ")} <= set(NUMBERS)


def test_the_places_that_are_named_are_there() -> None:
    places = {place for entry in CATALOGUE for place in re.findall(r"`([a-z/_]+/[a-z_.]*)`", entry.also)}
    assert len(places) > 10
    missing = [place for place in places if not ((ROOT / "orchestrator" / place).exists() or (ROOT / place).exists())]
    assert missing == []


def test_the_lines_of_shipped_policies_that_pages_show_are_those_of_the_keys() -> None:
    causes, policies = ((DOCS / name).read_text(encoding="utf-8") for name in ("causes.md", "policies.md"))
    shown = [
        *(("pack.temperature_c", place) for place in re.findall(r"policies/li-ion-48v.yaml:\d+", causes)),
        *(("pack.current_a", place) for place in re.findall(r"the pack bears 11.0 A, (policies/\S+:\d+)", policies)),
    ]
    assert len(shown) > 2
    for key, place in shown:
        name = place.partition(".yaml")[0].removeprefix("policies/")
        assert load_policy(name).source.at(key) == place


def test_every_row_of_the_page_of_causes_is_one_line() -> None:
    rows = [line for line in cause_page.page().splitlines() if line.startswith("| `")]
    assert [row for row in rows if not row.endswith(" |")] == []
    assert len(rows) > len(LANGUAGES["en"].texts)


def test_the_page_of_the_simulator_names_every_scenario_that_ships() -> None:
    written = (DOCS / "simulate.md").read_text(encoding="utf-8")
    assert [name for name in shipped_names("configs/scenarios") if f"| `{name}` |" not in written] == []
