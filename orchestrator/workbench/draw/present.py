"""Writes a simulation's results: a page and a picture in a directory. Needs the extra `workbench`."""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from orchestrator.errors import OrchestratorError
from orchestrator.workbench.draw.page import save_page
from orchestrator.workbench.draw.plot import save_png
from orchestrator.workbench.draw.tradeoff import save_tradeoff
from orchestrator.workbench.simulate.simulation import Run
from orchestrator.workbench.simulate.sweep import Sweep, record

T = TypeVar("T")


def save(runs: Sequence[Run], directory: Path) -> list[Path]:
    """Write page and picture of the runs; returns their paths. Raises OrchestratorError if they cannot be written."""
    name = runs[0].scenario.scenario
    return write(runs, {directory / f"{name}.html": save_page, directory / f"{name}.png": save_png})


def save_sweep(sweep: Sweep, directory: Path) -> list[Path]:
    """Write picture and figures of a sweep; returns their paths. Raises OrchestratorError if that is impossible."""
    name = f"{sweep.scenario}-sweep"
    return write(sweep, {directory / f"{name}.png": save_tradeoff, directory / f"{name}.csv": _save_csv})


def _save_csv(sweep: Sweep, path: Path) -> None:
    records = [record(sweep.axes, point) for point in sweep.points]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(records[0]))
        writer.writeheader()
        writer.writerows(records)


def write(what: T, files: dict[Path, Callable[[T, Path], None]]) -> list[Path]:
    """Write `what` to each file with its function; returns the paths. Raises OrchestratorError if one fails."""
    for path, save_as in files.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            save_as(what, path)
        except OSError as error:
            raise OrchestratorError(f"{path} cannot be written: {error.strerror}") from None
    return list(files)
