"""Pages that are made from the code are as the code is."""

from pathlib import Path

from orchestrator.config.shipped import shipped_names
from tests.docs.fault_page import page

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_of_faults_is_the_table() -> None:
    written = (DOCS / "faults.md").read_text(encoding="utf-8")
    assert written == page(), "python -m tests.docs.fault_page > docs/faults.md"


def test_the_page_of_the_simulator_names_every_scenario_that_ships() -> None:
    written = (DOCS / "simulate.md").read_text(encoding="utf-8")
    assert [name for name in shipped_names("configs/scenarios") if f"| `{name}` |" not in written] == []
