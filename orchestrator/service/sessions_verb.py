"""`orchestrator sessions`: what each charge took, read from the record; needs no running service."""

import argparse
import re
import sys
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from orchestrator.columns import json_text, own_width
from orchestrator.config.ports import wiring
from orchestrator.errors import CauseError, UsageError
from orchestrator.model import Cause
from orchestrator.record.lines import Record
from orchestrator.record.months import FOLDER
from orchestrator.record.reading import charges_in
from orchestrator.record.shown import shown
from orchestrator.record.table import as_csv, table
from orchestrator.record.utc import unix_s
from orchestrator.service.chosen import choose
from orchestrator.service.where import HERE
from orchestrator.show import own_language
from orchestrator.text.catalogue import say

#: The journal of the service started by deploy/orchestrator.service.
INSTALLED = Path("/var/lib/orchestrator/journal")
#: What `--since` counts in.
AGO_S = {"min": 60.0, "h": 3600.0, "d": 86_400.0}


def sessions(arguments: argparse.Namespace) -> int:
    """Print the charges that the command line means, the newest first."""
    charges = _charges(arguments)
    if arguments.limit is not None and arguments.limit < 1:
        raise UsageError(f"sessions: --limit {arguments.limit}: expected 1 or more")
    if arguments.show:
        return _show(charges, arguments)
    found = list(islice(_meant(charges, arguments), arguments.limit))
    language = own_language()
    if arguments.json:
        print(json_text(found))
    elif arguments.csv:
        sys.stdout.write(as_csv(found, language))
    elif found:
        print(table(found, language, own_width()))
    else:
        print(say(Cause("charges_none"), language))
    return 0


def _charges(arguments: argparse.Namespace) -> Iterator[Record]:
    folder = _journal(arguments) / FOLDER
    try:
        yield from charges_in(folder)
    except FileNotFoundError:
        return  # no charge has begun yet
    except OSError as error:
        raise CauseError(Cause.of("charges_unreadable", folder=str(folder), error=str(error.strerror))) from None


def _journal(arguments: argparse.Namespace) -> Path:
    """The journal's directory: the one named, that of the station file here, or of the installed service."""
    if arguments.journal is not None:
        named = Path(arguments.journal)
        if not named.is_dir():
            raise UsageError(f"sessions: --journal {named}: there is no such directory")
        return named
    try:
        if written := wiring(HERE).journal:
            return Path(written)
    except OSError:
        pass
    if INSTALLED.exists():
        return INSTALLED
    raise UsageError(
        f"sessions: no {HERE} in this folder names a journal, and there is no {INSTALLED}; name its directory with "
        "--journal DIR"
    )


def _show(charges: Iterator[Record], arguments: argparse.Namespace) -> int:
    """One charge; the end of its id will do."""
    if len(arguments.show) != 2 or arguments.show[0] != "show" or arguments.csv:
        raise UsageError(f"sessions {' '.join(arguments.show)}: expected 'sessions', or 'sessions show ID [--json]'")
    wanted = arguments.show[1].upper()
    found = next((charge for charge in charges if wanted and charge["id"].endswith(wanted)), None)
    if found is None:
        raise CauseError(Cause.of("charge_unknown", id=f"{arguments.show[1]:.40}"))
    print(json_text(found) if arguments.json else shown(found, own_language(), own_width()))
    return 0


def _meant(charges: Iterator[Record], arguments: argparse.Namespace) -> Iterator[Record]:
    since_s = _since_s(arguments.since) if arguments.since else None
    for charge in charges:
        if arguments.bay and not choose(arguments.bay, (), [str(charge.get("bay"))]).bays:
            continue
        if arguments.battery and charge["battery"]["id"] != arguments.battery:
            continue
        if since_s is None or (charge.get("end") or charge["last"])["unix_s"] >= since_s:
            yield charge


def _since_s(text: str) -> float:
    """The moment that a person named: so long ago, a date, or a local time."""
    if (ago := re.fullmatch(r"(\d{1,6})\s*(min|h|d)", text)) is not None:
        return time.time() - int(ago[1]) * AGO_S[ago[2]]
    try:
        return unix_s(text)
    except (OSError, OverflowError, ValueError):
        raise UsageError(f"--since {text}: expected 90min, 2h, 7d, 2026-11-28 or 2026-11-28T06:00") from None
