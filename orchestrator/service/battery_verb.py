"""`orchestrator battery`: which batteries were charged, and the life of one."""

import argparse
from collections.abc import Iterator

from orchestrator.columns import aligned, json_text, own_width
from orchestrator.errors import CauseError, UsageError
from orchestrator.model import Cause
from orchestrator.record.charges import Battery
from orchestrator.record.health import health
from orchestrator.record.health_shown import as_fields, health_lines
from orchestrator.record.life import batteries_head, charges_table, life, soh
from orchestrator.record.sections import Row, Section, as_text
from orchestrator.record.utc import utc
from orchestrator.service.record_place import charges_of, journal_of
from orchestrator.show import own_language
from orchestrator.text.catalogue import say

#: So many charges are shown where --limit says nothing else.
USUAL = 50


def battery(arguments: argparse.Namespace) -> int:
    """Print the list, or the life of one."""
    if arguments.limit is not None and arguments.limit < 0:
        raise UsageError(f"battery: --limit {arguments.limit}: expected the number of charges, or 0 for all")
    return _list(arguments) if arguments.battery is None else _life(arguments)


def _list(arguments: argparse.Namespace) -> int:
    with charges_of(journal_of("battery", arguments.journal)) as charges:
        found = list(charges.batteries())
    language = own_language()
    if arguments.json:
        print(json_text([one._asdict() | {"sources": one.sources.split(",")} for one in found]))
    elif found:
        print(aligned([batteries_head(language), *_rows(found, language)], own_width()))
    else:
        print(say(Cause("charges_none"), language))
    return 0


def _rows(found: list[Battery], language: str) -> Iterator[Row]:
    for one in found:
        days = (utc(moment_s)[:10] for moment_s in (one.first_s, one.last_s))
        amounts = f"{one.ah:.1f}", f"{one.wh / 1000:.2f}"
        yield (
            one.id,
            say(Cause.of("battery_sources", sources=tuple(one.sources.split(","))), language),
            str(one.charges),
            *days,
            *amounts,
            soh(one.soh_pct),
        )


def _life(arguments: argparse.Namespace) -> int:
    language, id_ = own_language(), arguments.battery
    with charges_of(journal_of("battery", arguments.journal)) as charges:
        found = list(charges.listed(battery=id_))
        if not found:
            raise CauseError(Cause.of("battery_unknown", battery=f"{id_:.80}"))
        whole = list(charges.whole([charge["id"] for charge in found]))
    now = health(id_, whole)
    if arguments.json:
        print(json_text({"health": as_fields(now), "charges": whole[: arguments.limit or None]}))
        return 0
    limit = USUAL if arguments.limit is None else arguments.limit or None
    lines = Section(say(Cause("health"), language), [(line,) for line in health_lines(now, language)])
    print(as_text([*life(found, language), lines], own_width()), end="\n\n")
    print(charges_table(found[:limit], language, own_width()))
    return 0
