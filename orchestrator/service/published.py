"""The status as its readers follow it: each bay's entry with the revision of its last change, made once for all.

Theory of operation. At each look a bay whose state, cause, faults, step, command or alarm have changed is described
anew. All others are described anew once a second, spread over that second, so that no look takes long; of very many
bays 64 a second, in turn: so the controller pays no more, however many there are. The station's parts are made again
once a second, and whenever a bay has changed; but the supplies' figures, which follow those of many bays, are told once
a second only. What has only grown older is no change, unless it is too old. A changed entry replaces the one before and
gets the next revision; a reader that has been told everything up to some revision is told all entries above it, however
many changes it has missed. So there is one slot for each bay and no queue, whatever a reader does.
"""

import json
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from math import ceil, inf
from operator import attrgetter
from typing import Any, Protocol, cast

from orchestrator.model import Decision

#: How often an entry is described anew if no more than figures may differ, and how many are in a second at most.
PERIOD_S, RATE = 1.0, 64
#: This much earlier is not too early.
EARLY_S = 0.1
MINUTE_S = 60.0
#: The part of the document that always changes; each line has its own.
TIME = "time"
#: The part that is figures: a bay that changes does not have it told at once.
FIGURES = frozenset({"supplies"})
#: The maximum number of entries described at one look.
MOST = 24

Fields = Mapping[str, object]


class Bay(Protocol):
    """What is needed of a bay."""

    name: str
    decision: Decision | None

    def status(self) -> Fields:
        """The bay's part of the status document."""


class Published:
    """The entries, and the lines for their readers. `station` makes the document's other parts. Used by one thread."""

    def __init__(self, bays: Sequence[Bay], station: Callable[[], Fields], wall: Callable[[], float]) -> None:
        self.revision = 0
        self.instance = os.urandom(8).hex()  #: of another run it is another, whose revisions begin anew
        period_s = max(PERIOD_S, len(bays) / RATE)
        self._entries = [_Entry(bay, period_s, number / len(bays)) for number, bay in enumerate(bays)]
        self._wall = wall
        self._station, self._station_s = station, -inf  # when they are due
        self._parts: dict[str, tuple[int, object]] = {}  # the station's, with the revisions of their last changes
        self._lines: dict[int, bytes] = {}  # what is new since a revision, as of the last look

    def look(self, now_s: float) -> bool:
        """Describe what is due, most urgent first; returns whether that was everything."""
        self._lines.clear()
        turned = [entry for entry in self._entries if entry.has_turned()]
        due = sorted((entry for entry in self._entries if now_s >= entry.due_s), key=lambda entry: entry.due_s)
        todo = list(dict.fromkeys((*turned, *due)))
        changed: list[_Entry] = [entry for entry in todo[:MOST] if entry.describe(now_s)]
        whole = now_s >= self._station_s
        parts = dict(self._changed_parts(() if whole else FIGURES)) if turned or whole else {}
        if whole:
            self._station_s = now_s + PERIOD_S
        if changed or parts:
            self.revision += 1
        for entry in changed:
            entry.revision = self.revision
        self._parts |= {name: (self.revision, part) for name, part in parts.items()}
        return len(todo) <= MOST

    def _changed_parts(self, but: Collection[str]) -> Iterator[tuple[str, object]]:
        for name, part in self._station().items():
            if name not in (TIME, *but) and (name not in self._parts or self._parts[name][1] != part):
                yield name, part

    def document(self) -> bytes:
        """The first line for a reader: the whole status document."""
        head = {"ok": True, "revision": self.revision, "instance": self.instance}
        parts = encoded({TIME: round(self._wall(), 3), **{name: part for name, (_, part) in self._parts.items()}})
        bays = b", ".join(entry.text for entry in self._entries)
        return b'%b, "document": {%b, "bays": [%b]}}\n' % (encoded(head)[:-1], parts[1:-1], bays)

    def since(self, revision: int) -> bytes:
        """The line for a reader that has been told everything up to `revision`: what has changed, if anything."""
        if revision not in self._lines:
            line = [b'"revision": %d, "time": %.3f' % (self.revision, self._wall())]
            if bays := [entry.named for entry in self._entries if entry.revision > revision]:
                line.append(b'"bays": {%b}' % b", ".join(bays))
            if parts := {name: part for name, (changed, part) in self._parts.items() if changed > revision}:
                line.append(b'"station": %b' % encoded(parts))
            self._lines[revision] = b"{%b}\n" % b", ".join(line)
        return self._lines[revision]


class _Entry:
    """One bay's entry, described in each period at this `part` of it."""

    def __init__(self, bay: Bay, period_s: float, part: float) -> None:
        self.revision, self.due_s, self.text = 0, -inf, b""
        self._bay, self._key = bay, encoded(bay.name)
        self._period_s, self._phase_s = period_s, part * period_s
        self._seen: Decision | None = None  # the last decision looked at
        self._gist: object = None  # of the one described last
        self._lasting: object = None
        self._last: Fields = {}  # as encoded last …
        self._members: dict[str, bytes] = {}  # … and its members

    @property
    def named(self) -> bytes:
        """The entry as a member of an object."""
        return b"%b: %b" % (self._key, self.text)

    def has_turned(self) -> bool:
        """Whether the bay has decided anything that people must see at once."""
        decision = self._bay.decision
        if decision is not self._seen and _gist(decision) == self._gist:
            self._seen = decision
        return decision is not self._seen

    def describe(self, now_s: float) -> bool:
        """Make the entry; returns whether it differs in more than its age."""
        seen, status = self._bay.decision, self._bay.status()
        lasting = _lasting(status)
        changed = lasting != self._lasting
        if changed:
            self.text, self._lasting = self._encoded(status), lasting
        self._seen, self._gist = seen, _gist(seen)  # not before: it may have failed
        periods = ceil((now_s - EARLY_S - self._phase_s) / self._period_s) + 1
        self.due_s = self._phase_s + periods * self._period_s
        return changed

    def _encoded(self, status: Fields) -> bytes:
        """As JSON; what is as before in it is not encoded again: of a bay that charges, most is."""
        last, before = self._last, self._members
        now = {
            name: before[name] if last.get(name, self) == value else b'"%b": %b' % (name.encode(), encoded(value))
            for name, value in status.items()
        }
        self._last, self._members = status, now
        return b"{%b}" % b", ".join(now.values())


GIST = attrgetter("state", "alarm", "faults", "setpoint", "command")


def _gist(decision: Decision | None) -> object:
    """What people must see at once if it changes; figures can wait."""
    if decision is None:
        return None
    cause, step = decision.cause, decision.step
    return GIST(decision), cause.id, cause.key, step and (step.index, step.key), decision.session is None


def _lasting(status: Fields) -> object:
    """What counts of an entry: not the ages, except those of values that are too old, as people read them."""
    charger, battery = (dict(cast("Mapping[str, Any]", status[part])) for part in ("charger", "battery"))
    del charger["t_s"]
    age_s, ages_s = charger.pop("age_s"), battery.pop("age_s")
    old = {name: _age(ages_s[name]) for name in battery["old"]}
    return {**status, "charger": charger, "battery": battery, "age": charger["old"] and _age(age_s), "ages": old}


def _age(age_s: float) -> float:
    """In seconds, later in minutes."""
    return age_s // 1 if age_s < 2 * MINUTE_S else age_s // MINUTE_S * MINUTE_S


JSON = json.JSONEncoder(ensure_ascii=False)


def encoded(value: object) -> bytes:
    """As JSON."""
    return JSON.encode(value).encode(errors="backslashreplace")
