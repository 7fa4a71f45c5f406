"""The live stream: server-sent events, each reader at its own pace, none with a queue.

Events: `link` (whether the controller is there, and since when), `whole` (the document, to begin with) and `change`.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping

from orchestrator.model import Cause
from orchestrator.northbound.link import Link
from orchestrator.northbound.refusal import RefusalError
from orchestrator.northbound.told import PAGE, Teller, encoded

#: The most streams at once, of all readers together.
MOST = 32
#: Something is sent at least this often; the reader takes silence for a lost connection.
ALIVE_S = 5.0
#: How long a reader may be asked to wait by the long poll: the page takes 12 s of silence for a lost connection.
POLL_S = 8.0
#: Readers that are up to date are told of changes at most so often.
PACE_S = 0.1
ALIVE = ":\n\n"

#: Who reads; None: somebody who may not, or not any more.
Who = Callable[[], Mapping[str, str] | None]


class Streams:
    """All readers of the stream."""

    def __init__(self, link: Link) -> None:
        self._link, self._teller, self._open = link, Teller(link.picture), 0

    def check_room(self) -> None:
        """RefusalError if all places are taken."""
        if self._open >= MOST:
            raise RefusalError(503, Cause.of("streams_taken", most=MOST), {"retry-after": "10"})

    async def events(self, seen: int | None, language: str, me: Who) -> AsyncIterator[str]:
        """The events for one reader, who has seen this revision, until it leaves or may not read any more."""
        self._open += 1
        try:
            async for one in self._events(seen, language, me):
                yield one
        finally:
            self._open -= 1

    async def _events(self, seen: int | None, language: str, me: Who) -> AsyncIterator[str]:
        link, told = self._link, (False, 0.0)
        while (who := me()) is not None:
            new = False
            if told != (link.connected, link.since_s):
                new, told = True, (link.connected, link.since_s)
                yield event("link", encoded(self.link_fields()))
            if link.picture.known and seen != link.picture.revision:
                change, members = self._teller.since(seen, language)
                new, seen = True, change.revision
                yield event("whole", _whole(members, who), seen) if change.whole else event("change", members, seen)
                await asyncio.sleep(PACE_S)
            if not new and not await link.changed(ALIVE_S):
                yield ALIVE

    async def poll(self, seen: int | None, language: str, me: Who) -> str:
        """The same for one who cannot read a stream: JSON, as soon as there is something that it has not seen."""
        link = self._link
        if seen == link.picture.revision:
            await link.changed(POLL_S)
        beside = f'"link":{encoded(self.link_fields())}'
        if not link.picture.known:
            return _whole(f'"revision":null,"document":null,{beside}', me())
        change, members = self._teller.since(seen, language)
        return _whole(f"{members},{beside}", me()) if change.whole else f"{{{members},{beside}}}"

    def link_fields(self) -> dict[str, object]:
        """Whether the controller answers, and since when that is so, in Unix seconds."""
        return {"connected": self._link.connected, "since": round(self._link.since_s, 3)}


def _whole(members: str, who: object) -> str:
    """A whole document has beside it what the page needs to begin with."""
    return f'{{{members},"me":{encoded(who)},"page":{encoded(PAGE)}}}'


def event(name: str, members: str, revision: int | None = None) -> str:
    """One server-sent event. JSON as we write it has no line ends."""
    data = members if members.startswith("{") else f"{{{members}}}"
    id_ = "" if revision is None else f"id: {revision}\n"
    return f"{id_}event: {name}\ndata: {data}\n\n"
