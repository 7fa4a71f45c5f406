"""The link to the controller: keeps the picture as it is there, and knows when the controller is gone.

A service that knows `watch` sends what changes. One that refuses it, as it is older or has enough readers, is asked for
its status once a second; `watch` is tried again with the next connection.
"""

import asyncio
import json
import os
from collections.abc import AsyncGenerator, Callable, Mapping
from contextlib import aclosing, suppress
from pathlib import Path
from time import time
from typing import Any

from orchestrator.lastresort.asking import ask
from orchestrator.northbound.picture import Picture
from orchestrator.northbound.told import encoded

#: How often a service without `watch` is asked, and how long it may take.
POLL_S, ANSWER_S = 1.0, 5.0
#: The service says something at least every 5 s.
SILENT_S = 12.0
#: The longest line of `watch`, and more than 128 bays need; whoever sends more is no service of ours.
MOST_LINE = 8 * 1024 * 1024
#: The pause before the next attempt, doubled after each.
RETRY_S, LONGEST_S = 0.5, 5.0

Sources = Callable[[], list[Path]]


class NoStreamError(Exception):
    """The service is older than `watch`, or has no place for one more reader."""


class Link:
    """Keeps `picture` up to date. Belongs to the event loop; whoever waits is woken by every change."""

    def __init__(self, sockets: Sources) -> None:
        self.picture = Picture(revision=int(time() * 1000))
        self.connected = False
        self.since_s = time()  #: Unix time of the connection, or of what was heard last before it was lost
        self._heard_s = self.since_s
        self._begun = False  # whether this connection has delivered a document
        self._sockets = sockets
        self._news = asyncio.Event()
        self._polls = False

    async def changed(self, within_s: float) -> bool:
        """Wait for news, at most so long; returns whether there is any."""
        news = self._news
        with suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                await news.wait()
        return news.is_set()

    async def run(self) -> None:
        """Until cancelled."""
        pause_s = RETRY_S
        while True:
            self._begun = False
            try:
                async with aclosing(self._lines()) as lines:
                    async for line in lines:
                        self._take(line)
                        pause_s = RETRY_S
            except NoStreamError:
                self._polls = True
                continue
            except Exception:  # noqa: BLE001, S110 - gone, hung up, silent, or it sends nonsense: what is shown is old now
                pass
            self._connected(connected=False)
            self._polls = False  # an update may have come meanwhile
            await asyncio.sleep(pause_s)
            pause_s = min(2 * pause_s, LONGEST_S)

    def _lines(self) -> AsyncGenerator[Mapping[str, Any], None]:
        path = next((one for one in self._sockets() if may_open(one)), self._sockets()[-1])
        return polled(path) if self._polls else watched(path)

    def _take(self, line: Mapping[str, Any]) -> None:
        """One line of the stream: the whole document, what changed, or nothing new."""
        document = line.get("document")
        if document is None and not self._begun:
            raise ValueError("a change, and of what is not known")
        time_s = (line if document is None else document).get("time")
        if isinstance(time_s, int | float):
            self.picture.time = time_s
        if document is not None:
            new = self.picture.replace(document)
        else:
            new = self.picture.merge(line.get("bays") or {}, line.get("station") or {}, list(line.get("gone") or ()))
        self._begun, self._heard_s = True, time()
        if not self._connected(connected=True) and new:
            self._wake()

    def _connected(self, *, connected: bool) -> bool:
        """Note it; returns whether that is news."""
        if connected == self.connected:
            return False
        self.connected, self.since_s = connected, self._heard_s
        self._wake()
        return True

    def _wake(self) -> None:
        self._news.set()
        self._news = asyncio.Event()


def may_open(path: Path) -> bool:
    """Whether the socket is there for us."""
    return os.access(path, os.R_OK | os.W_OK)


async def watched(path: Path) -> AsyncGenerator[Mapping[str, Any], None]:
    """The lines of `watch`. OSError, ValueError or EOFError when that is over; NoStreamError if there is none."""
    async with asyncio.timeout(ANSWER_S):
        reader, writer = await asyncio.open_unix_connection(path, limit=MOST_LINE)
    try:
        writer.write(b'{"verb": "watch", "version": 1}\n')
        while True:
            async with asyncio.timeout(SILENT_S):
                text = await reader.readline()
            if not text.endswith(b"\n"):
                raise EOFError
            line = json.loads(text, parse_constant=_no_number)
            if line.get("ok") is False:
                raise NoStreamError
            yield line
    finally:
        writer.close()


async def polled(path: Path) -> AsyncGenerator[Mapping[str, Any], None]:
    """The status once a second, as lines of `watch`."""
    while True:
        document = await asyncio.to_thread(ask, path, {"verb": "status"}, ANSWER_S)
        encoded(document)  # a ValueError if no browser could read it
        yield {"document": document}
        await asyncio.sleep(POLL_S)


def _no_number(text: str) -> float:
    """NaN and Infinity are no JSON: no browser could read the document."""
    raise ValueError(text)
