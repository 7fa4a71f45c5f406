"""The charges on record, asked of the index: which there are, and what the files say of each."""

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from orchestrator.model import Cause
from orchestrator.record.index import opened
from orchestrator.record.lines import Record
from orchestrator.record.row import as_record
from orchestrator.record.tables import records

#: Ids are in the order of the charges.
_BATTERIES = """
SELECT of, sources, charges, first.begin_unix_s + 60 * first.begin_offset_min,
last.begin_unix_s + 60 * last.begin_offset_min, ah, wh, last.soh_pct
FROM (
    SELECT battery AS of, group_concat(DISTINCT battery_source) AS sources, count(*) AS charges,
    min(id) AS first_id, max(id) AS last_id, sum(charger_ah) AS ah, sum(charger_wh) AS wh
    FROM charges GROUP BY battery
) JOIN charges AS first ON first.id = first_id JOIN charges AS last ON last.id = last_id
ORDER BY last_id DESC
"""
#: As many whole records are read at once.
CHUNK = 1000


class Battery(NamedTuple):
    """What the charges of one battery come to."""

    id: str
    sources: str  #: where the id is from: names with commas between
    charges: int
    first_s: float  #: when its first charge began, and its last, by the station's clock
    last_s: float
    ah: float
    wh: float
    soh_pct: float | None  #: as its BMU said last


class Charges:
    """Those in this folder now; OSError if its files cannot be read. `say` is told what is wrong with the index.

    The index is in `home`, if that is another directory.
    """

    def __init__(self, folder: Path, say: Callable[[Cause], None] = lambda _: None, home: Path | None = None) -> None:
        self._folder, self._db = folder, opened(folder, say, home)

    def listed(
        self,
        *,
        bays: Sequence[str] | None = None,
        battery: str | None = None,
        since_s: float | None = None,
        began_s: tuple[float, float] | None = None,
        before: str | None = None,
        limit: int | None = None,
    ) -> Iterator[Record]:
        """What lists need of each, the newest first; not those over before `since_s`, or begun outside `began_s`.

        `before`: only those older than the charge with this id.
        """
        where, values = ["1"], list[object]()
        if bays is not None:
            where.append(f"bay IN ({', '.join('?' * len(bays))})")
            values += bays
        from_s, to_s = began_s or (None, None)
        for column, value in (
            ("battery =", battery), ("last_unix_s >=", since_s), ("begin_unix_s >=", from_s), ("begin_unix_s <", to_s),
            ("id <", before),
        ):  # fmt: skip
            if value is not None:
                where.append(f"{column} ?")
                values.append(value)
        asked = f"SELECT * FROM charges WHERE {' AND '.join(where)} ORDER BY id DESC LIMIT ?"  # noqa: S608 - our own words
        for row in self._db.execute(asked, (*values, -1 if limit is None else limit)):
            yield as_record(row)

    def whole(self, ids: Sequence[str]) -> Iterator[Record]:
        """These charges as the files have them, in this order."""
        left = iter(ids)
        while chunk := list(islice(left, CHUNK)):
            yield from records(self._db, self._folder, chunk)

    def named(self, end: str) -> str | None:
        """The newest charge whose id ends so."""
        asked = "SELECT id FROM charges WHERE substr(id, -length(?1)) = ?1 ORDER BY id DESC LIMIT 1"
        found = self._db.execute(asked, (end,)).fetchone()
        return None if found is None else str(found[0])

    def batteries(self) -> Iterator[Battery]:
        """All that have been charged; that of the newest charge first."""
        return (Battery(*row) for row in self._db.execute(_BATTERIES))

    def bays(self) -> list[str]:
        """All that have had a charge."""
        return [bay for (bay,) in self._db.execute("SELECT DISTINCT bay FROM charges ORDER BY bay")]
