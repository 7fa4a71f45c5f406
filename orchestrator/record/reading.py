"""Reads the charges of a station from its files: torn, doubled and disordered lines change nothing.

An end has all of a charge, so of the many checkpoints only those of open charges are decoded.
"""

from collections.abc import Iterable, Iterator
from gzip import GzipFile
from pathlib import Path

from orchestrator.record.lines import BEGIN, CHECKPOINT, Record, decoded, scanned
from orchestrator.record.months import PACKED, files


class Charges:
    """What is known of each charge in the lines taken so far."""

    def __init__(self) -> None:
        self._begins: dict[str, Record] = {}
        self._ends: dict[str, Record] = {}
        self._checkpoints: dict[str, list[bytes]] = {}

    def take(self, lines: Iterable[bytes]) -> None:
        """More lines, in any order."""
        for kind, id_, line in scanned(lines):
            if id_ in self._ends:
                continue
            if kind == CHECKPOINT:
                self._checkpoints.setdefault(id_, []).append(line)
            elif (record := decoded(line)) is not None:
                (self._begins if kind == BEGIN else self._ends)[id_] = record
                if kind != BEGIN:
                    self._begins.pop(id_, None)
                    self._checkpoints.pop(id_, None)

    def all(self) -> Iterator[Record]:
        """Each charge in one record, the newest first; one that is open as of its newest checkpoint."""
        for id_ in sorted({*self._begins, *self._ends}, reverse=True):
            yield self._ends.get(id_) or self._open(id_)

    def _open(self, id_: str) -> Record:
        found = [self._begins[id_], *filter(None, map(decoded, self._checkpoints.get(id_, ())))]
        return {**found[0], **max(found, key=lambda record: int(record["n"])), "type": CHECKPOINT}


def charges_in(folder: Path) -> Iterator[Record]:
    """All charges in the files of this folder, the newest first; OSError where it cannot be read."""
    charges = Charges()
    for name in files(path.name for path in folder.iterdir()):
        with (folder / name).open("rb") as file:
            charges.take(GzipFile(fileobj=file) if name.endswith(PACKED) else file)
    yield from charges.all()
