"""The life of a battery, from its charges: where its id is from, what it took, why it needs a look. Pure."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from orchestrator.model import Cause
from orchestrator.record.lines import Record
from orchestrator.record.report import looks
from orchestrator.record.sections import Section, heads
from orchestrator.record.table import DASH, began, table
from orchestrator.text.catalogue import say

#: How it is said where an id is from; another source is shown as it is.
SOURCES = {
    "typed": "battery_id_typed", "assumed": "battery_id_assumed", "serial_number": "battery_id_serial_number",
}  # fmt: skip
DAY = 10  #: characters of a date


def life(charges: Sequence[Record], language: str) -> list[Section]:
    """Of the charges of one battery, the newest first; there is at least one."""
    found = []
    for title, part in PARTS:
        if lines := [(say(cause, language),) for cause in part(charges)]:
            found.append(Section(say(Cause(title), language) if title else "", lines))
    return found


def _span(charges: Sequence[Record]) -> dict[str, Any]:
    return {"charges": len(charges), "begin_at": began(charges[-1])[:DAY], "end_at": began(charges[0])[:DAY]}


def _sum(charges: Sequence[Record]) -> Iterator[Cause]:
    ah, wh = (sum(charge["charger"][name] for charge in charges) for name in ("ah", "wh"))
    yield Cause.of("battery_life", battery=charges[0]["battery"]["id"], ah=ah, wh=wh, **_span(charges))
    known = [charge["values"]["soh_pct"]["end"] for charge in charges if charge["values"]["soh_pct"]]
    if known:
        yield Cause.of("battery_soh", first_pct=known[-1], last_pct=known[0])
    hot = [one["highest"] for charge in charges if (one := charge["values"]["temperature_c"])]
    if hot:
        yield Cause.of("battery_hottest", highest_c=max(hot))


def _ids(charges: Sequence[Record]) -> Iterator[Cause]:
    for source in dict.fromkeys(charge["battery"]["source"] for charge in reversed(charges)):
        of = [charge for charge in charges if charge["battery"]["source"] == source]
        yield Cause(SOURCES.get(source, source), tuple(_span(of).items()))


#: The title of each part, "" for none, and what makes its lines.
PARTS: tuple[tuple[str, Callable[[Sequence[Record]], Iterator[Cause]]], ...] = (
    ("", _sum),
    ("battery_ids", _ids),
    ("battery_look", looks),
)


def batteries_head(language: str) -> tuple[str, ...]:
    """Of the list of batteries."""
    return heads("batteries_head", language)


def charges_table(charges: Sequence[Record], language: str, width: int) -> str:
    """Its charges, in a table with a title."""
    return f"{say(Cause('battery_charges'), language)}\n{table(charges, language, width)}"


def soh(soh_pct: float | None) -> str:
    """As a cell."""
    return DASH if soh_pct is None else f"{soh_pct:.0f} %"
