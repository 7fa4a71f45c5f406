"""What earlier runs of the service have left in the records: open charges, and the last one of each bay. Pure."""

from collections.abc import Iterable
from dataclasses import replace

from orchestrator.record.charge import Charge
from orchestrator.record.lines import BEGIN, CHECKPOINT, END, Record, decoded, restored, scanned


class Earlier:
    """Takes the lines of whole files in any order; keeps little of what is over."""

    def __init__(self) -> None:
        self._begins: dict[str, Record] = {}
        self._checkpoints: dict[str, list[bytes]] = {}
        self._ended: set[str] = set()
        self._last: dict[str, Record] = {}  # bay → the record of the last charge that ended there
        self.last_id = ""  #: the newest charge's

    def take(self, lines: Iterable[bytes]) -> None:
        """More lines. Checkpoints are many: those of an open charge are decoded in the end."""
        for kind, id_, line in scanned(lines):
            if id_ in self._ended:
                continue
            if kind == CHECKPOINT:
                self._checkpoints.setdefault(id_, []).append(line)
            elif (record := decoded(line)) is not None:
                self._take(id_, record)

    def _take(self, id_: str, record: Record) -> None:
        self.last_id = max(self.last_id, id_)
        if record["type"] == BEGIN:
            self._begins[id_] = record
        elif record["type"] == END:
            self._ended.add(id_)
            for known in (self._begins, self._checkpoints):
                known.pop(id_, None)
            bay = str(record.get("bay"))
            if id_ > self._last.get(bay, {"id": ""})["id"]:
                self._last[bay] = record

    @property
    def is_whole(self) -> bool:
        """Whether the begin of every open charge is known; others stand in older files."""
        return self._checkpoints.keys() <= self._begins.keys()

    def open(self) -> list[Charge]:
        """The charges that nobody has ended, the oldest first."""
        return [charge for id_ in sorted(self._begins) if (charge := self._open(id_)) is not None]

    def _open(self, id_: str) -> Charge | None:
        """As of its newest whole record."""
        begin = self._begins[id_]
        found = [begin, *filter(None, map(decoded, self._checkpoints.get(id_, ())))]
        for record in sorted(found, key=lambda one: int(one["n"]), reverse=True):
            try:
                return restored(begin, record)
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
