"""What earlier runs of the service have left in the records: open charges, and the last one of each bay. Pure."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import chain

from orchestrator.record.charge import Charge
from orchestrator.record.fold import Fold, Piece
from orchestrator.record.lines import Record, restored


class Earlier:
    """Takes the lines of whole files in any order."""

    def __init__(self) -> None:
        self._fold = Fold(self._ended)
        self._last: dict[str, Record] = {}  # bay → the record of the last charge that ended there

    def take(self, lines: Iterable[bytes]) -> None:
        """More lines."""
        self._fold.take(lines)

    def _ended(self, piece: Piece) -> None:
        bay = str(piece.record.get("bay"))
        if piece.record["id"] > self._last.get(bay, {"id": ""})["id"]:
            self._last[bay] = piece.record

    @property
    def last_id(self) -> str:
        """The newest charge's; "" for none."""
        return self._fold.last_id

    @property
    def is_whole(self) -> bool:
        """Whether the begin of every open charge is known; others stand in older files."""
        return self._fold.is_whole

    def open(self) -> list[Charge]:
        """The charges that nobody has ended, the oldest first."""
        return [charge for id_ in sorted(self._fold.begins) if (charge := self._open(id_)) is not None]

    def _open(self, id_: str) -> Charge | None:
        """As of its newest whole record."""
        begin = self._fold.begins[id_]
        for piece in chain(self._fold.checkpoints(id_), (begin,)):
            try:
                return restored(begin.record, piece.record)
            except ValueError:
                continue
        return None

    def last(self) -> dict[str, Charge]:
        """By bay the last charge that has ended."""
        found = {}
        for bay, record in self._last.items():
            try:
                found[bay] = replace(restored(record, record), result=record["result"])
            except (LookupError, ValueError):
                continue
        return found
