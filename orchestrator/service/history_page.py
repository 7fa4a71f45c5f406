"""What happened, in lines for a terminal or a file."""

from collections.abc import Iterator

from orchestrator.columns import cut, folded, json_text, width_of
from orchestrator.model import Cause
from orchestrator.page import COLOURS, PLAIN, SIGNS
from orchestrator.service.history import Happened
from orchestrator.service.wallclock import WallClock
from orchestrator.text.catalogue import say

#: Before what needed nobody.
NO_SIGN = "   "
#: "2026-11-28 21:02:14" in two parts.
DATE, TIME = slice(0, 10), slice(11, 19)


class HistoryPage:
    """`lines` are those of one event. A terminal (`width` > 0) has a line for each day, a file dates everywhere."""

    def __init__(self, language: str, width: int, *, colour: bool) -> None:
        self._station = say(Cause("event_station"), language)
        self._width, self._colour, self._day = width, colour, ""

    def lines(self, one: Happened) -> Iterator[str]:
        """Its line, folded, and the date before it if the day is a new one."""
        stamp = WallClock(one.unix_s, one.unix_s).stamp
        if self._width and stamp[DATE] != self._day:
            self._day = stamp[DATE]
            yield self._day
        head = f"{SIGNS.get(one.level, NO_SIGN)}{stamp[TIME] if self._width else stamp}  {one.bay or self._station}  "
        begin, end = (COLOURS[one.level], PLAIN) if self._colour and one.level else ("", "")
        beside = width_of(head) * 2 <= self._width  # else it would stand in a narrow column
        text = folded(one.text, self._width, head) if beside else folded(head + one.text, self._width)
        for line in text.split("\n"):
            yield from (f"{begin}{part}{end}" for part in cut(line, self._width))


def as_json(one: Happened) -> str:
    """One line for programs."""
    return json_text({
        "wall": one.wall,
        "bay": one.bay,
        "kind": one.kind,
        "id": one.id,
        "text": one.text,
        "level": one.level,
        "by": one.by,
    })  # fmt: skip
