"""`orchestrator report`: a month of charges, and the batteries that need a look, by their health at its end as well."""

import argparse
from collections.abc import Mapping, Sequence

from orchestrator.columns import json_text, own_width
from orchestrator.errors import UsageError
from orchestrator.model import Cause
from orchestrator.record.charges import Charges
from orchestrator.record.health import YEAR_S, for_capacity, health
from orchestrator.record.health_shown import warning
from orchestrator.record.lines import Record
from orchestrator.record.report import MONTH, as_fields, is_of, report, span_s
from orchestrator.record.sections import as_page, as_text
from orchestrator.record.table import began
from orchestrator.service.record_place import charges_of, journal_of, write_page
from orchestrator.show import own_language
from orchestrator.text.catalogue import say


def report_month(arguments: argparse.Namespace) -> int:
    """Print it, or write it as a page."""
    if arguments.month is not None and not MONTH.fullmatch(arguments.month):
        raise UsageError(f"report: --month {arguments.month}: expected a year and a month, such as 2026-11")
    language = own_language()
    with charges_of(journal_of("report", arguments.journal)) as charges:
        month = arguments.month or _newest(charges)
        of = [charge for charge in charges.listed(began_s=span_s(month)) if is_of(charge, month)] if month else []
        warnings = _warnings(charges, month, of) if month else {}
    if arguments.json:
        print(json_text(as_fields(month or "", of, warnings, language)))
        return 0
    if month is None or not of:
        print(say(Cause.of("report_none", month=month) if month else Cause("charges_none"), language))
        return 0
    sections = report(month, of, warnings, language)
    if arguments.html is None:
        print(as_text(sections, own_width()))
    else:
        write_page(arguments.html, as_page(say(Cause.of("report_title", month=month), language), language, sections))
    return 0


def _warnings(charges: Charges, month: str, of: Sequence[Record]) -> Mapping[str, Sequence[Cause]]:
    """What the health of these charges' batteries was at the month's end, if somebody must look at them."""
    end_s, found = span_s(month)[1], dict[str, Sequence[Cause]]()
    for battery in {str(charge["battery"]["id"]) for charge in of}:
        year = charges.listed(battery=battery, began_s=(end_s - YEAR_S, end_s))  # whole records would take minutes
        if (cause := warning(health(battery, map(for_capacity, year)))) is not None:
            found[battery] = (cause,)
    return found


def _newest(charges: Charges) -> str | None:
    """The month in which the newest charge began."""
    return next((month for charge in charges.listed(limit=1) if (month := began(charge)[:7])), None)
