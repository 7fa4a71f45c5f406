"""The readers of `watch`: they are told the status, and then what changes, one JSON object a line, until they leave.

Theory of operation. One thread serves all of them, and neither the control loop nor a request ever waits for it. A
reader is written its next line only when it has taken the one before, all of it, so a slow one misses states between
and always gets the newest next. Nobody's slowness costs more than one line and a socket's buffer, and whoever takes
nothing for half a minute is sent away. While nobody reads, the thread sleeps.
"""

import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from math import inf
from time import sleep, thread_time

from orchestrator.model import Cause
from orchestrator.service.client import Client
from orchestrator.service.published import Published

#: The version of the lines and of the document in the first of them.
VERSION = 1
#: The most readers at once.
MOST_READERS = 16
#: How often the bays are looked at while somebody reads, and how soon again if there is more to describe or to write.
TURN_S, SOON_S = 0.08, 0.005
#: After each turn the thread rests for this multiple of the turn's CPU time.
REST = 4.0
#: A reader is told something this often (it is promised 5 s), and is sent away if it takes nothing for this long.
KEEP_ALIVE_S, PATIENCE_S = 4.0, 30.0


class Streams:
    """All readers. `say` informs people of a defect."""

    def __init__(self, published: Published, clock: Callable[[], float], say: Callable[[Cause], None]) -> None:
        self._published, self._clock, self._say = published, clock, say
        self._coming: deque[Client] = deque()
        self._readers: list[_Reader] = []
        self._trouble: Cause | None = None  # the last defect
        self._look_s = -inf  # when the bays are looked at next
        self._wake, self._lock, self._closing = threading.Event(), threading.Lock(), False
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)

    def start(self) -> None:
        """Begin to serve readers."""
        self._thread.start()

    def close(self) -> None:
        """Send everybody away, soon."""
        self._closing = True
        self._wake.set()

    def take(self, client: Client) -> Cause | None:
        """Serve this client from now on; returns why not. Any thread."""
        version = client.request.get("version", VERSION)
        if version != VERSION:
            return Cause.of("watch_version", version=f"{version!r:.20}", known=VERSION)
        with self._lock:
            if len(self._coming) + len(self._readers) >= MOST_READERS:
                return Cause.of("too_many_readers", limit=MOST_READERS)
            self._coming.append(client)
        self._wake.set()
        return None

    def _run(self) -> None:
        patience_s: float | None = None
        while not self._closing:
            self._wake.wait(patience_s)
            self._wake.clear()
            began_s = thread_time()
            try:
                patience_s = self.turn(self._clock())
            except Exception as error:  # noqa: BLE001 - the readers may come again
                self._complain(Cause.of("socket_internal", error=repr(error)))
                self._keep([])
            sleep(REST * (thread_time() - began_s))
        self._keep([])

    def turn(self, now_s: float) -> float | None:
        """Look at the bays and write what can be written; returns when to do so again, None for never."""
        with self._lock:
            self._readers += [_Reader(client, now_s) for client in self._coming]
            self._coming.clear()
        if not self._readers:
            return None
        whole = True
        if now_s >= self._look_s or any(reader.revision is None for reader in self._readers):
            whole = self._published.look(now_s)
            self._look_s = now_s + (TURN_S if whole else SOON_S)
        self._keep([reader for reader in self._readers if reader.goes_on(self._published, now_s, whole=whole)])
        writing = any(reader.progresses for reader in self._readers)
        return SOON_S if writing else max(self._look_s - now_s, SOON_S)

    def _complain(self, trouble: Cause) -> None:
        if trouble != self._trouble:
            self._trouble = trouble
            self._say(trouble)

    def _keep(self, readers: list["_Reader"]) -> None:
        """These readers stay, the others are sent away."""
        with self._lock:
            left, self._readers = self._readers, readers
        for reader in left:
            if reader not in readers:
                reader.client.close()


class _Reader:
    """One reader, and what it has been told."""

    def __init__(self, client: Client, now_s: float) -> None:
        self.client = client
        self.revision: int | None = None  #: it has been told everything up to here; None: nothing yet
        self.progresses = False  #: it is taking a long line
        self._took_s = self._told_s = now_s  # when it last took something, and when its last line was begun
        self._waiting = 0  # the bytes that it had not taken after the last turn

    def goes_on(self, published: Published, now_s: float, *, whole: bool) -> bool:
        """Write what it can take now; returns False if it has left, or must."""
        with suppress(OSError):
            return not self.client.has_left() and self._write(published, now_s, whole=whole)
        return False

    def _write(self, published: Published, now_s: float, *, whole: bool) -> bool:
        waiting = self.client.waiting
        self.progresses = waiting < self._waiting
        if not waiting or self.progresses:
            self._took_s = now_s
        line = b"" if waiting else self._line(published, now_s, whole=whole)
        if line:
            self.client.answer(line, now_s)
            self._told_s, self.progresses = now_s, True
        if self.client.left:
            self.client.write()
        self.progresses = self.progresses and self.client.left > 0
        self._waiting = self.client.waiting
        return now_s - self._took_s <= PATIENCE_S

    def _line(self, published: Published, now_s: float, *, whole: bool) -> bytes:
        """The next line for it; b"" for none."""
        if self.revision is None:
            line = published.document() if whole else b""
            self.revision = published.revision if whole else None
            return line
        if self.revision == published.revision and now_s - self._told_s < KEEP_ALIVE_S:
            return b""
        line, self.revision = published.since(self.revision), published.revision
        return line
