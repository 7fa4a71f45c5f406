"""Pages that are made from the code are as the code is."""

from pathlib import Path

from orchestrator.workbench.diagram import diagram, mermaid
from tests.docs.fault_page import page

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def test_the_page_of_faults_is_the_table() -> None:
    written = (DOCS / "faults.md").read_text(encoding="utf-8")
    assert written == page(), "python -m tests.docs.fault_page > docs/faults.md"


def test_the_picture_in_the_readme_is_the_machine() -> None:
    written = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"```mermaid\n{mermaid(diagram())}```" in written, "orchestrator diagram"
