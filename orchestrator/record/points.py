"""The points of a charge's curve, read back from its file. Pure but for the reading."""

import csv
import gzip
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from orchestrator.record.curve import FOLDER, SUFFIX, whole_size


@dataclass(frozen=True, slots=True)
class Point:
    """One moment of a charge."""

    elapsed_s: float
    state: str
    values: Mapping[str, float]  #: without those that nobody knew


def points_of(folder: Path, id_: str) -> list[Point]:
    """The curve of a charge in the folder of the records; none if it is not kept (any more). OSError as of any file."""
    try:
        data = (folder / FOLDER / f"{id_}{SUFFIX}").read_bytes()
    except FileNotFoundError:
        return []
    try:
        text = gzip.decompress(data[: whole_size(data)]).decode(errors="replace")
    except (EOFError, zlib.error, gzip.BadGzipFile):
        return []
    return list(_points(text.splitlines()))


def _points(lines: Iterable[str]) -> Iterator[Point]:
    for row in csv.DictReader(lines):
        values = {name: number for name, cell in row.items() if (number := _number(cell)) is not None}
        if "elapsed_s" in values:
            yield Point(values.pop("elapsed_s"), str(row.get("state")), values)


def _number(cell: object) -> float | None:
    try:
        number = float(str(cell))
    except ValueError:
        return None
    return number if isfinite(number) else None
