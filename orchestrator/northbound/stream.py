"""The live stream: server-sent events, each reader at its own pace, none with a queue.

Events: `link` (whether the controller is there, and since when), `whole` (the document, to begin with) and `change`.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from typing import NamedTuple

from orchestrator.model import Cause
from orchestrator.northbound.link import Link
from orchestrator.northbound.packed import HEAD, piece
from orchestrator.northbound.refusal import RefusalError
from orchestrator.northbound.told import PAGE, Teller, Told, encoded

#: The most streams at once, of all readers together.
MOST = 32
#: Something is sent at least this often; the reader takes silence for a lost connection.
ALIVE_S = 5.0
#: How long a reader may be asked to wait by the long poll: the page takes 12 s of silence for a lost connection.
POLL_S = 8.0
#: Readers that are up to date are told of changes at most so often.
PACE_S = 0.1
#: How long the long poll waits while nothing is known of the station.
UNKNOWN_S = 1.0

#: Who reads; None: somebody who may not, or not any more.
Who = Callable[[], Mapping[str, str] | None]


class Event(NamedTuple):
    """One server-sent event; JSON as we write it has no line ends. `told` is shared with other readers."""

    begin: str
    told: Told | None = None
    end: str = ""

    @property
    def plain(self) -> bytes:
        """As text."""
        return f"{self.begin}{self.told.members if self.told is not None else ''}{self.end}".encode()

    @property
    def packed(self) -> bytes:
        """As a piece of a gzip stream."""
        if self.told is None:
            return piece(self.begin)
        return piece(self.begin) + self.told.packed + piece(self.end)


ALIVE = Event(":\n\n")


class Streams:
    """All readers of the stream."""

    def __init__(self, link: Link) -> None:
        self._link, self._teller, self._open = link, Teller(link.picture), 0

    def check_room(self) -> None:
        """RefusalError if all places are taken."""
        if self._open >= MOST:
            raise RefusalError(503, Cause.of("streams_taken", most=MOST), {"retry-after": "10"})

    async def events(self, seen: int | None, language: str, me: Who) -> AsyncIterator[Event]:
        """The events for one reader, who has seen this revision, until it leaves or may not read any more."""
        self._open += 1
        try:
            async for one in self._events(seen, language, me):
                yield one
        finally:
            self._open -= 1

    async def _events(self, seen: int | None, language: str, me: Who) -> AsyncIterator[Event]:
        link, shown = self._link, (False, 0.0)
        while (who := me()) is not None:
            new = False
            if shown != (link.connected, link.since_s):
                new, shown = True, (link.connected, link.since_s)
                yield Event(f"event: link\ndata: {encoded(self.link_fields())}\n\n")
            if link.picture.known and seen != link.picture.revision:
                told = self._teller.since(seen, language)
                new, seen = True, told.change.revision
                name = "whole" if told.change.whole else "change"
                yield Event(f"id: {seen}\nevent: {name}\ndata: {{", told, f"{_beside(told, who)}}}\n\n")
                await asyncio.sleep(PACE_S)
            if not new and not await link.changed(ALIVE_S):
                yield ALIVE

    async def poll(self, seen: int | None, language: str, me: Who) -> str:
        """The same for one who cannot read a stream: JSON, as soon as there is something that it has not seen."""
        link = self._link
        if not link.picture.known:
            await link.changed(UNKNOWN_S)
        elif seen == link.picture.revision:
            await link.changed(POLL_S)
        beside = f'"link":{encoded(self.link_fields())}'
        if not link.picture.known:
            return f'{{"revision":null,"document":null,{beside}{_own(me())}}}'
        told = self._teller.since(seen, language)
        return f"{{{told.members},{beside}{_beside(told, me())}}}"

    def link_fields(self) -> dict[str, object]:
        """Whether the controller answers, and since when; if not, when it was last heard. In Unix seconds."""
        return {"connected": self._link.connected, "since": round(self._link.since_s, 3)}


def _beside(told: Told, who: object) -> str:
    """What a whole document has beside it: what the page needs to begin with."""
    return _own(who) if told.change.whole else ""


def _own(who: object) -> str:
    return f',"me":{encoded(who)},"page":{encoded(PAGE)}'


async def sent(events: AsyncIterator[Event], *, packed: bool) -> AsyncIterator[bytes]:
    """The events as they go over the wire."""
    if packed:
        yield HEAD
    async for event in events:
        yield event.packed if packed else event.plain
