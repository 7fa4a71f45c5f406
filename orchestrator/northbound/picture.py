"""The newest status document, and since which revision each part of it is as it is. Pure.

Theory of operation. A reader says which revision it has seen, and gets what has changed since then, each part once and
as it is now. So nothing is queued for anybody: a slow reader loses intermediate states, never the newest, and costs no
memory. Revisions are our own and only grow; the first is made from the time of day, so that a number from before a
restart of this process is never one of ours.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Document = Mapping[str, Any]

#: Keys of the status document that are no state of the station; its time goes on, and is no news.
TRANSPORT = frozenset({"ok", "bays", "revision", "time"})
#: As many removed bays are remembered; whoever has seen none of that gets the whole document.
MOST_GONE = 256


@dataclass(frozen=True, slots=True)
class Change:
    """What a reader has not seen yet: everything (`whole`), or parts."""

    revision: int
    whole: bool
    bays: tuple[Document, ...]
    station: Document
    gone: tuple[str, ...] = ()
    time: float | None = None  #: Unix time at the service; None: one that does not tell


@dataclass(slots=True)
class Picture:
    """The station as last told. Belongs to the event loop."""

    revision: int
    time: float | None = None  #: Unix time of what was told last, by the service's clock
    first: int = 0  #: a reader that has not seen this revision needs the whole document; 0: there is none yet
    _bays: dict[str, Document] = field(default_factory=dict)
    _station: dict[str, Any] = field(default_factory=dict)
    _bay_seen: dict[str, int] = field(default_factory=dict)  #: the revision that last changed each bay
    _key_seen: dict[str, int] = field(default_factory=dict)
    _gone: dict[str, int] = field(default_factory=dict)

    @property
    def known(self) -> bool:
        """Whether anything was told yet."""
        return self.first > 0

    @property
    def language(self) -> str:
        """The language that the service writes its texts in."""
        return str(self._station.get("language", ""))

    def replace(self, document: Document) -> bool:
        """The whole document as it is now; returns whether anything in it is new. ValueError if it is none."""
        bays = {_name(bay): bay for bay in document["bays"]}
        station = {name: value for name, value in document.items() if name not in TRANSPORT}
        left = [name for name in self._bays if name in bays]
        in_place = left == list(bays)[: len(left)]
        gone_keys = self._station.keys() - station.keys()
        if not self.known or not in_place or gone_keys:
            self._begin(bays, station)
            return True
        gone = [name for name in self._bays if name not in bays]
        return self.merge(bays, station, gone)

    def merge(self, bays: Mapping[str, Document], station: Document, gone: list[str]) -> bool:
        """Take what has changed; returns whether that is anything."""
        new = {name: bay for name, bay in bays.items() if self._bays.get(name) != bay}
        keys = {
            name: value
            for name, value in station.items()
            if name not in TRANSPORT and (name not in self._station or self._station[name] != value)
        }
        gone = [name for name in gone if name in self._bays]
        if not (new or keys or gone):
            return False
        self.revision += 1
        self._bays.update(new)
        self._station.update(keys)
        self._bay_seen.update(dict.fromkeys(new, self.revision))
        self._key_seen.update(dict.fromkeys(keys, self.revision))
        for name in new:
            self._gone.pop(name, None)
        for name in gone:
            del self._bays[name], self._bay_seen[name]
            self._gone[name] = self.revision
        if len(self._gone) > MOST_GONE:
            self._gone.clear()
            self.first = self.revision
        return True

    def since(self, seen: int | None) -> Change:
        """What a reader has not seen that has seen this revision of ours; None: nothing."""
        if seen is None or not self.first <= seen <= self.revision:
            bays, station = tuple(self._bays.values()), dict(self._station)
            return Change(self.revision, whole=True, bays=bays, station=station, time=self.time)
        return Change(
            self.revision,
            whole=False,
            bays=tuple(bay for name, bay in self._bays.items() if self._bay_seen[name] > seen),
            station={name: value for name, value in self._station.items() if self._key_seen[name] > seen},
            gone=tuple(name for name, revision in self._gone.items() if revision > seen),
            time=self.time,
        )

    def _begin(self, bays: dict[str, Document], station: dict[str, Any]) -> None:
        self.revision += 1
        self.first = self.revision
        self._bays, self._station, self._gone = bays, station, {}
        self._bay_seen = dict.fromkeys(bays, self.revision)
        self._key_seen = dict.fromkeys(station, self.revision)


def _name(bay: Document) -> str:
    name = bay["name"]
    if not isinstance(name, str):
        raise ValueError(f"{name!r:.80} is no name")
    return name
