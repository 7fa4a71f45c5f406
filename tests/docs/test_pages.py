"""Pages that are made from the code are as the code is."""

from pathlib import Path

from tests.docs.fault_page import page

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_of_faults_is_the_table() -> None:
    written = (DOCS / "faults.md").read_text(encoding="utf-8")
    assert written == page(), "python -m tests.docs.fault_page > docs/faults.md"
