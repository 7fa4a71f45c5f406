"""How long a station's journal will reach back, and what it writes: an estimate from measured figures."""

from collections import Counter
from collections.abc import Iterator

from orchestrator.config.station import Station
from orchestrator.service.journal import EVENTS_SHARE

#: What one charging bay writes for a replay, compressed, by the number of bays on its CAN bus: up to that many, bytes a
#: second. Several bays write less each: their records have much in common. Measured, with a margin, by
#: `tests/proof/test_journal_size.py`, with volts that never stand still.
SNAPSHOTS_B_S = ((2, 50.0), (4, 38.0), (128, 30.0))
ALONE_B_S = 80.0
#: What its events add: some twenty kilobytes for a charge of two hours, written as text and again compressed.
EVENTS_B_S = 3.0
DAY_S, MB = 86_400.0, 1_000_000


def snapshots_b_s(station: Station) -> float:
    """Bytes a second for the replay, with every bay charging."""
    if len(station.bays) == 1:
        return ALONE_B_S
    on_bus = Counter(bay.battery.can for bay in station.bays).values()
    return sum(count * next(b_s for most, b_s in SNAPSHOTS_B_S if count <= most) for count in on_bus)


def reach(station: Station) -> Iterator[str]:
    """For people, with its line: how far back the journal reaches, and what it writes a day, if all bays charge."""
    journal, bays = station.journal, len(station.bays)
    events_b_s = EVENTS_B_S * bays
    place = station.source.at("journal.max_mb")
    who = "the bay" if bays == 1 else f"{bays} bays"
    whole = f"{place}: journal: with {who} charging day and night, {journal.max_mb:g} MB"
    if not journal.snapshots:
        days = journal.max_mb * MB * EVENTS_SHARE / events_b_s / DAY_S
        yield f"{whole} hold the events of {_span(days)}, and nothing to replay; {_daily(events_b_s)}"
        return
    b_s = snapshots_b_s(station)
    days = journal.max_mb * MB * (1 - EVENTS_SHARE) / b_s / DAY_S
    yield f"{whole} hold {_span(days)} to replay; {_daily(b_s + events_b_s)}"


def _span(days: float) -> str:
    """About so long."""
    return f"about {days:.0f} days" if days >= 3 else f"about {days * 24:.0f} hours"


def _daily(b_s: float) -> str:
    return f"about {b_s * DAY_S / MB:.0f} MB are written a day"
