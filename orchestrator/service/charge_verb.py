"""`orchestrator sessions show`: everything about one charge, as text or as a page that needs no network."""

import argparse
from collections.abc import Iterator
from pathlib import Path

from orchestrator.columns import json_text, own_width
from orchestrator.errors import CauseError, OrchestratorError
from orchestrator.model import Cause
from orchestrator.record.charges import Charges
from orchestrator.record.lines import Record
from orchestrator.record.months import FOLDER
from orchestrator.record.picture import svg
from orchestrator.record.points import points_of
from orchestrator.record.sections import Row, Section, as_page, as_text
from orchestrator.record.shown import sections, title
from orchestrator.record.utc import utc
from orchestrator.service.history_verb import between
from orchestrator.service.record_place import charges_of, journal_of, readable, write_page
from orchestrator.show import own_language
from orchestrator.text.catalogue import say

#: More events of one charge are not on its page.
EVENTS = 200


def show(arguments: argparse.Namespace, end: str) -> int:
    """One charge; the end of its id will do."""
    journal, language = journal_of("sessions", arguments.journal), own_language()
    charge = charge_named(journal, end)
    if arguments.json:
        print(json_text(charge))
        return 0
    try:
        said = sections(charge, language)
    except ValueError as error:
        raise CauseError(Cause.of("charge_damaged", id=charge["id"], error=str(error))) from None
    if arguments.html is None:
        print(as_text(said, own_width()))
        return 0
    with readable(journal / FOLDER):
        picture = svg(points_of(journal / FOLDER, charge["id"]), language)
    events = Section(say(Cause("charge_events"), language), list(_events(journal, charge, language)))
    said[0] = Section("", said[0].rows[1:])  # the first is the title
    write_page(arguments.html, as_page(title(charge, language), language, [*said, events], picture))
    return 0


def charge_named(journal: Path, end: str) -> Record:
    """The whole record of the newest charge whose id ends so."""
    with charges_of(journal) as charges:
        found = next(_named(charges, end), None)
    if found is None:
        raise CauseError(Cause.of("charge_unknown", id=f"{end:.40}"))
    return found


def _named(charges: Charges, end: str) -> Iterator[Record]:
    id_ = charges.named(end.upper()) if end else None
    return charges.whole([id_] if id_ is not None else [])


def stretch(charge: Record) -> tuple[str, str]:
    """From when to when it went, as the journal writes times."""
    return charge["begin"]["utc"], (charge.get("end") or charge["last"])["utc"]


def _events(journal: Path, charge: Record, language: str) -> Iterator[Row]:
    """What the journal still has of its bay meanwhile, the first ones."""
    offset_s = charge["begin"]["offset_min"] * 60
    try:
        for event in between(journal, charge["bay"], *stretch(charge), language, EVENTS):
            yield utc(event.unix_s + offset_s)[:19].replace("T", " "), event.text
    except OrchestratorError:
        return  # there is no journal any more, or none for us
