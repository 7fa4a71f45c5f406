"""These tests need the guest (`make test-guest`); elsewhere none is collected."""

import os
from pathlib import Path

import pytest

from tests.guest import figures

FOLDER = os.environ.get("GUEST")
collect_ignore_glob = [] if FOLDER else ["test_*.py"]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if FOLDER and figures.FIGURES:
        figures.write(Path(FOLDER))
        terminalreporter.section("figures")
        for line in figures.table():
            terminalreporter.write_line(line)
