"""What a simulation is shown as: a page and a picture in a directory. Needs the extra `workbench`."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from orchestrator.errors import OrchestratorError
from orchestrator.workbench.page import save_page
from orchestrator.workbench.plot import save_png
from orchestrator.workbench.simulation import Run

T = TypeVar("T")


def save(runs: Sequence[Run], directory: Path) -> list[Path]:
    """Write page and picture of the runs; their paths. Raises OrchestratorError when that place cannot be written."""
    name = runs[0].scenario.scenario
    return write(runs, {directory / f"{name}.html": save_page, directory / f"{name}.png": save_png})


def write(what: T, files: dict[Path, Callable[[T, Path], None]]) -> list[Path]:
    """Write `what` to each file in its way; the paths. Raises OrchestratorError when a place cannot be written."""
    for path, save_as in files.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            save_as(what, path)
        except OSError as error:
            raise OrchestratorError(f"{path} cannot be written: {error.strerror}") from None
    return list(files)
