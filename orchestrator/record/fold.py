"""Folds the lines of records: what is over and what is open. Torn, doubled and disordered lines change nothing. Pure.

An end has all of a charge, so of the many checkpoints only those of open charges are decoded. Little of what is over is
kept.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from orchestrator.record.lines import BEGIN, CHECKPOINT, Record, Scanned, decoded, scanned


class Piece(NamedTuple):
    """One record, and where its line is."""

    record: Record
    file: str
    at: int
    length: int


class Fold:
    """Takes the lines of whole files in any order; `ended` is told of each end, once a charge."""

    def __init__(self, ended: Callable[[Piece], None]) -> None:
        self.begins: dict[str, Piece] = {}  #: of the open charges
        self.last_id = ""  #: the newest charge's
        self._checkpoints: dict[str, list[tuple[str, Scanned]]] = {}
        self._ended: set[str] = set()
        self._tell = ended

    def take(self, lines: Iterable[bytes], file: str = "", at: int = 0) -> None:
        """More lines, which begin at `at` of this file."""
        for found in scanned(lines, at):
            if found.id in self._ended:
                continue
            if found.kind == CHECKPOINT:
                self._checkpoints.setdefault(found.id, []).append((file, found))
            elif (piece := _piece(file, found)) is not None:
                self._take(found.id, piece)

    def _take(self, id_: str, piece: Piece) -> None:
        self.last_id = max(self.last_id, id_)
        if piece.record["type"] == BEGIN:
            self.begins.setdefault(id_, piece)
            return
        self._ended.add(id_)
        self.begins.pop(id_, None)
        self._checkpoints.pop(id_, None)
        self._tell(piece)

    @property
    def open(self) -> list[str]:
        """The charges that nothing has ended, the oldest first; of some only checkpoints may have been seen."""
        return sorted({*self.begins, *self._checkpoints})

    @property
    def is_whole(self) -> bool:
        """Whether the begin of every open charge is known; others stand in older files."""
        return self._checkpoints.keys() <= self.begins.keys()

    def checkpoints(self, id_: str) -> Iterator[Piece]:
        """Those of an open charge that are whole, the newest first."""
        known = sorted(self._checkpoints.get(id_, ()), key=lambda one: (-one[1].n, one[0], one[1].at))
        for file, found in known:
            if (piece := _piece(file, found)) is not None:
                yield piece


def _piece(file: str, found: Scanned) -> Piece | None:
    """The record on this line; None for a torn one."""
    record = decoded(found.text)
    if record is None or (record["type"], record["id"], record["n"]) != (found.kind, found.id, found.n):
        return None
    return Piece(record, file, found.at, len(found.text))
