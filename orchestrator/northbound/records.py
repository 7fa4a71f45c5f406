"""What is on record, as JSON: charges with their curves, batteries with their health, and what happened at a bay.

Everything here reads files and may take its time; it runs in a thread.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from orchestrator.errors import OrchestratorError
from orchestrator.model import Cause
from orchestrator.northbound.fields import moment_field, number_field, text_field
from orchestrator.northbound.refusal import RefusalError
from orchestrator.record.charges import Charges
from orchestrator.record.health import health
from orchestrator.record.health_shown import as_fields, health_lines
from orchestrator.record.lines import Record
from orchestrator.record.months import FOLDER
from orchestrator.record.points import points_of
from orchestrator.record.shown import sections
from orchestrator.record.table import as_csv, why_ended
from orchestrator.service.history_verb import newest_events

#: So many charges are listed where nobody says how many, and no more at once; in a CSV file there may be more.
USUAL, MOST, MOST_CSV = 50, 500, 20_000
#: The longest name of a bay or a battery, or id of a charge.
NAME = 80
#: So many events are told of a bay.
EVENTS = 30

Query = Mapping[str, str]


class Records:
    """The records beside a journal, and their index, which may be in `home`. `say` is told what is wrong with it."""

    def __init__(self, journal: Callable[[], Path], say: Callable[[Cause], None], home: Path | None) -> None:
        self._journal, self._say, self._home, self._said = journal, say, home, frozenset[str]()

    def sessions(self, query: Query, language: str) -> dict[str, Any]:
        """The charges that are meant, the newest first; the next page is `before` the last of them."""
        limit = number_field(query, "limit", MOST, USUAL) or USUAL
        return {"sessions": [_told(charge, language) for charge in self._listed(self._charges(), query, limit)]}

    def csv(self, query: Query, language: str) -> str:
        """The same for a spreadsheet."""
        return "".join(as_csv(self._listed(self._charges(), query, MOST_CSV), language))

    def session(self, id_: str, language: str) -> dict[str, Any]:
        """One charge: its record, its curve, and what it comes to in sentences."""
        charges = self._charges()
        found = charges.named(id_.upper()) if id_ else None
        charge = next(charges.whole([found]), None) if found is not None else None
        if charge is None:
            raise RefusalError(404, Cause.of("charge_unknown", id=f"{id_:.40}"))
        points = points_of(self._folder, charge["id"])
        return {
            "session": _told(charge, language),
            "points": [{"elapsed_s": one.elapsed_s, "state": one.state, **one.values} for one in points],
            "lines": _lines(charge, language),
        }

    def batteries(self) -> dict[str, Any]:
        """All that were charged, that of the newest charge first."""
        charges = self._charges()
        return {
            "batteries": [
                {
                    "id": one.id,
                    "sources": one.sources.split(","),
                    "charges": one.charges,
                    "ah": one.ah,
                    "wh": one.wh,
                    "soh_pct": one.soh_pct,
                    "last_unix_s": next(iter(charges.listed(battery=one.id, limit=1)))["begin"]["unix_s"],
                }
                for one in charges.batteries()
            ]
        }

    def battery(self, id_: str, language: str) -> dict[str, Any]:
        """One battery: its health, as data and in sentences, and its charges."""
        charges = self._charges()
        found = list(charges.listed(battery=id_))
        if not found:
            raise RefusalError(404, Cause.of("battery_unknown", battery=f"{id_:.80}"))
        now = health(id_, list(charges.whole([charge["id"] for charge in found])))
        return {
            "battery": id_,
            "health": as_fields(now),
            "lines": health_lines(now, language),
            "sessions": [_told(charge, language) for charge in found[:USUAL]],
        }

    def events(self, query: Query, language: str) -> dict[str, Any]:
        """What happened last at a bay, the newest last."""
        try:
            found = newest_events(self._journal(), text_field(query, "bay", NAME), language, EVENTS)
        except RefusalError:
            raise
        except (OrchestratorError, OSError) as error:
            raise RefusalError(503, Cause.of("no_journal", why=str(error))) from None
        return {
            "events": [
                {
                    "unix_s": one.unix_s, "bay": one.bay, "kind": one.kind, "id": one.id, "text": one.text,
                    "level": one.level, "needs": bool(one.level), "by": one.by,
                }
                for one in found
            ]
        }  # fmt: skip

    @property
    def _folder(self) -> Path:
        return self._journal() / FOLDER

    def _charges(self) -> Charges:
        try:
            return Charges(self._folder, self._say_once, self._home)
        except OSError as error:
            why = error.strerror or str(error)
            raise RefusalError(503, Cause.of("charges_unreadable", folder=error.filename, error=why)) from None

    def _say_once(self, cause: Cause) -> None:
        """The index of a journal in which we may not write is made anew each time; that is no news."""
        if cause.id not in self._said:
            self._said |= {cause.id}
            self._say(cause)

    @staticmethod
    def _listed(charges: Charges, query: Query, limit: int) -> Iterator[Record]:
        bay, battery, before = (text_field(query, name, NAME, default="") for name in ("bay", "battery", "before"))
        until_s = moment_field(query, "until")
        return charges.listed(
            bays=[bay] if bay else None,
            battery=battery or None,
            since_s=moment_field(query, "since"),
            began_s=(0.0, until_s) if until_s is not None else None,
            before=before or None,
            limit=limit,
        )


def _told(charge: Record, language: str) -> dict[str, Any]:
    """A charge with why it ended, in words."""
    return {**charge, "result_text": why_ended(charge, language) if charge.get("result") else ""}


def _lines(charge: Record, language: str) -> list[str]:
    """What `orchestrator sessions show` says in sentences; nothing of a damaged record."""
    try:
        said = sections(charge, language)
    except ValueError:
        return []
    return [row[0] for section in said if not section.has_head for row in section.rows if len(row) == 1]
