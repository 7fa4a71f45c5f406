"""`orchestrator sessions`: what each charge took, read from the record; needs no running service."""

import argparse
import sys
import time
from collections.abc import Iterator

from orchestrator.columns import json_text, own_width
from orchestrator.errors import CauseError, UsageError
from orchestrator.model import Cause
from orchestrator.record.charges import Charges
from orchestrator.record.lines import Record
from orchestrator.record.table import as_csv, table
from orchestrator.record.utc import unix_s
from orchestrator.service.chosen import choose
from orchestrator.service.record_place import charges_of, journal_of, tell
from orchestrator.service.timespan import moment
from orchestrator.show import own_language
from orchestrator.text.catalogue import say

#: So many are in the table where neither --since nor --limit says how many.
USUAL = 50


def sessions(arguments: argparse.Namespace) -> int:
    """Do what the command line says: list the charges, or do something with one, or with the index."""
    for option, verb in (("html", "show"), ("policy", "replay")):
        if getattr(arguments, option) is not None and arguments.words[:1] != [verb]:
            raise UsageError(f"sessions: --{option} is for 'sessions {verb} ID'")
    match arguments.words:
        case []:
            return _list(arguments)
        case ["show", end] if not arguments.csv:
            from orchestrator.service.charge_verb import show  # a list does not wait for what it needs

            return show(arguments, end)
        case ["replay", end]:
            return _replay(arguments, end)
        case ["rebuild"]:
            return _rebuild(arguments)
    raise UsageError(
        f"sessions {' '.join(arguments.words)}: expected 'sessions', 'sessions show ID [--json | --html FILE]', "
        "'sessions replay ID [--policy FILE]' or 'sessions rebuild'"
    )


def _list(arguments: argparse.Namespace) -> int:
    """Print the charges that the command line means, the newest first."""
    if arguments.limit is not None and arguments.limit < 0:
        raise UsageError(f"sessions: --limit {arguments.limit}: expected the number of charges, or 0 for all")
    since = moment("--since", arguments.since or "", time.time())
    language = own_language()
    with charges_of(journal_of("sessions", arguments.journal)) as charges:
        if arguments.json:
            _print_json(charges.whole([charge["id"] for charge in _meant(charges, arguments, since)]))
            return 0
        if arguments.csv:
            sys.stdout.writelines(as_csv(_meant(charges, arguments, since), language))
            return 0
        found = list(_meant(charges, arguments, since, USUAL + 1))
        none = Cause("charges_none_such" if not found and charges.bays() else "charges_none")
    shown = found if arguments.limit is not None or since else found[:USUAL]
    print(table(shown, language, own_width()) if found else say(none, language))
    if len(shown) > 1:
        ah, wh = (sum(charge["charger"][name] for charge in shown) for name in ("ah", "wh"))
        print(say(Cause.of("charges_total", charges=len(shown), ah=ah, kwh=wh / 1000), language))
    if len(shown) < len(found):
        print(say(Cause.of("charges_more", shown=USUAL), language))
    return 0


def _meant(charges: Charges, arguments: argparse.Namespace, since: str, usual: int = 0) -> Iterator[Record]:
    bays = choose(arguments.bay, (), charges.bays()).bays if arguments.bay else None
    limit = arguments.limit if arguments.limit is not None else 0 if since else usual
    return charges.listed(
        bays=bays, battery=arguments.battery, since_s=unix_s(since) if since else None, limit=limit or None
    )


def _print_json(records: Iterator[Record]) -> None:
    """A list, one after the other: there may be many."""
    separator = "["
    for record in records:
        sys.stdout.write(f"{separator}{json_text(record)}")
        separator = ",\n "
    print("[]" if separator == "[" else "]")


def _replay(arguments: argparse.Namespace, end: str) -> int:
    """Decide one charge again; 1 if a decision is not as recorded."""
    from orchestrator.service.charge_verb import charge_named, stretch

    journal = journal_of("sessions", arguments.journal)
    charge = charge_named(journal, end)
    return int(arguments.replay(journal, arguments.policy, charge["bay"], *stretch(charge)))


def _rebuild(arguments: argparse.Namespace) -> int:
    """Build the index anew."""
    from sqlite3 import Error

    from orchestrator.record.index import BusyError, rebuilt
    from orchestrator.record.months import FOLDER

    folder = journal_of("sessions", arguments.journal) / FOLDER
    if not folder.exists():
        print(say(Cause("charges_none"), own_language()))
        return 0
    try:
        count = rebuilt(folder, tell)
    except BusyError:
        raise CauseError(Cause("index_busy")) from None
    except (OSError, Error) as error:
        raise CauseError(Cause.of("index_failed", folder=str(folder), error=str(error))) from None
    print(say(Cause.of("index_rebuilt", charges=count), own_language()))
    return 0
