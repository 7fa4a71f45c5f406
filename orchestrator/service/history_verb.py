"""`orchestrator history`: what happened, in sentences, newest last."""

import argparse
import json
import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path

from orchestrator.columns import own_colour, own_width
from orchestrator.errors import OrchestratorError, UsageError
from orchestrator.model import Cause
from orchestrator.service.chosen import is_plain
from orchestrator.service.history import UNTOLD, Happened, happened, newest
from orchestrator.service.history_page import HistoryPage, as_json
from orchestrator.service.journal_files import from_part
from orchestrator.service.journal_place import event_files, journal_place
from orchestrator.service.timespan import moment
from orchestrator.service.wallclock import WallClock
from orchestrator.show import own_language
from orchestrator.text.catalogue import say

#: So many are shown where neither --since nor --limit says how many.
USUAL = 50
#: The page of a bay has so many, and looks for them in the newest parts of the journal only.
ON_PAGE, PARTS = 10, 4
#: In these first bytes of a line stand its time, its bay and its kind.
HEAD = 400
#: How each line of a journal begins.
BEGIN = b'{"t":'


def history(arguments: argparse.Namespace) -> int:
    """Show it; 1 if nothing is recorded of what was asked for."""
    asked = _asked(arguments, time.time())
    files = event_files(journal_place(arguments.journal, arguments.socket))
    language = own_language()
    shown = _show(_found(files, asked, language, arguments.limit), language, programs=arguments.json)
    if asked.broken:
        print(f"orchestrator: {say(asked.passed_over(), language)}", file=sys.stderr)
    if not shown:
        print(f"orchestrator: {say(asked.nothing(), language)}", file=sys.stderr)
    return 0 if shown else 1


@dataclass(slots=True)
class Asked:
    """What is wanted, and what was seen on the way."""

    words: Sequence[str] = ()  #: names of bays, or patterns; none: all, and the station itself
    station: bool = False  #: only the station itself
    since: str = ""  #: as the journal writes times
    until: str = ""
    known: set[str] = field(default_factory=set)  #: the bays that were seen
    broken: int = 0  #: how many lines cannot be read …
    first_broken: str = ""  #: … and the first of them

    def may_be(self, text: bytes) -> bool:
        """Whether a line is worth reading: most are not. One that is none of ours is, to be told."""
        head = text[:HEAD]
        if not head.startswith(BEGIN):
            return True
        if self.station and not (_in_json("bay", "") in head or _in_json("kind", "station") in head):
            return False
        if any(_in_json("kind", kind) in head for kind in UNTOLD):
            return False
        return not self.words or not is_plain(self.words) or any(_in_json("bay", one) in head for one in self.words)

    def is_meant(self, one: Happened) -> bool:
        """Whether it is to be shown."""
        self.known.add(one.bay)
        if (self.since and one.wall < self.since) or (self.until and one.wall > self.until):
            return False
        if self.station:
            return not one.bay or one.kind == "station"
        return not self.words or any(one.bay == word or fnmatchcase(one.bay, word) for word in self.words)

    def nothing(self) -> Cause:
        """That nothing of this is recorded."""
        bays = tuple(sorted(filter(None, self.known))) or ("–",)
        known = Cause.of("history_of", bays=tuple(self.words), known=bays) if self.words else None
        return Cause.of("history_none", of=known)

    def note_broken(self, path: Path, number: int, text: str) -> None:
        """A line that cannot be read is passed over."""
        self.broken += 1
        self.first_broken = self.first_broken or f"{path}:{number}: {text}"

    def passed_over(self) -> Cause:
        """How much that was."""
        id_ = "history_broken" if self.broken == 1 else "history_broken_many"
        return Cause.of(id_, lines=self.broken, first=self.first_broken)


def _asked(arguments: argparse.Namespace, now_s: float) -> Asked:
    if arguments.limit is not None and arguments.limit < 0:
        raise UsageError("history: --limit is the number of events; 0 shows all of them")
    if arguments.station and arguments.bay:
        raise UsageError("history: --station shows the station itself: name bays, or --station")
    since, until = (moment(f"--{name}", getattr(arguments, name) or "", now_s) for name in ("since", "until"))
    return Asked(arguments.bay, arguments.station, since, until)


def _in_json(key: str, value: str) -> bytes:
    return f'"{key}":{json.dumps(value, ensure_ascii=False)}'.encode(errors="backslashreplace")


def _found(files: Sequence[Path], asked: Asked, language: str, limit: int | None) -> Iterable[Happened]:
    """The events in their order; no more of them are in memory at once than are to be shown."""

    def tell(paths: Sequence[Path]) -> Iterator[Happened]:
        return filter(asked.is_meant, happened(paths, language, asked.may_be, asked.note_broken))

    if asked.since:
        found = tell(from_part(files, asked.since))
        return deque(found, maxlen=limit) if limit else found
    if limit == 0:
        return tell(files)
    return newest(files, USUAL if limit is None else limit, tell)


def _show(found: Iterable[Happened], language: str, *, programs: bool) -> bool:
    """Print them; returns whether there were any."""
    page, shown = HistoryPage(language, own_width(), colour=own_colour()), False
    for one in found:
        shown = True
        for line in (as_json(one),) if programs else page.lines(one):
            print(line)
    sys.stdout.flush()
    return shown


def last_events(directory: Path, bay: str, language: str, now_s: float) -> list[tuple[str, str]]:
    """The newest sentences about one bay with their times, for its page; or why there are none."""
    clock = WallClock(now_s, now_s)
    try:
        found = newest_events(directory, bay, language, ON_PAGE)
    except OrchestratorError as error:
        return [("", say(Cause.of("no_journal", why=str(error)), language))]
    return [(clock.time_of_day(one.unix_s), one.text) for one in found] or [("", say(Cause("no_events"), language))]


def newest_events(directory: Path, bay: str, language: str, most: int) -> Iterable[Happened]:
    """The newest events of one bay, looked for in the newest parts of the journal only; OrchestratorError as below."""
    asked = Asked([bay])

    def tell(paths: Sequence[Path]) -> Iterator[Happened]:
        return filter(asked.is_meant, happened(paths, language, asked.may_be))

    return newest(event_files(directory)[-PARTS:], most, tell)


def between(directory: Path, bay: str, since: str, until: str, language: str, most: int) -> Iterator[Happened]:
    """The first events of one bay between two times, given as the journal writes them; OrchestratorError as above."""
    asked = Asked([bay], since=since, until=until)
    told = happened(from_part(event_files(directory), since), language, asked.may_be)
    return islice(filter(asked.is_meant, told), most)
