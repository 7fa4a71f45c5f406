"""One browser's connection: uvicorn's with h11, and limits that it lacks on time and number."""

import asyncio
import socket

from h11 import Data, EndOfMessage, LocalProtocolError, Response
from uvicorn import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from orchestrator.model import Cause
from orchestrator.northbound.refusal import RefusalError

#: The longest head of a request, its line included.
MOST_HEAD_BYTES = 16 * 1024
#: How long a head may take, from its first byte or from the connection on.
HEAD_S = 10.0
#: How long a reader may leave what was sent to it unread.
UNREAD_S = 20.0
#: The kernel's buffer for what is sent: more would be old news for a slow reader.
BUFFER = 128 * 1024
#: The most connections; one more displaces the one that has waited longest without a request.
MOST = 256


class Connection(H11Protocol):
    """Belongs to the event loop."""

    def __init__(self, config: Config, server_state: ServerState, crowd: "dict[Connection, None]") -> None:
        super().__init__(config, server_state, {})
        self._crowd = crowd
        self._head: asyncio.TimerHandle | None = None
        self._unread: asyncio.TimerHandle | None = None

    @property
    def waits(self) -> bool:
        """Whether it has no request that is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take part, if there is room."""
        super().connection_made(transport)
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
        if len(self._crowd) >= MOST:
            oldest = next((one for one in self._crowd if one.waits), self)
            oldest.transport.abort()
            self._crowd.pop(oldest, None)
            if oldest is self:
                return
        self._crowd[self] = None
        self._await_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """Leave."""
        super().connection_lost(exc)
        self._crowd.pop(self, None)
        for timer in (self._head, self._unread):
            _cancel(timer)

    def data_received(self, data: bytes) -> None:
        """Some bytes of a head or a body."""
        super().data_received(data)
        if self.waits and not self.transport.is_closing():
            self._await_head()
        else:
            _cancel(self._head)
            self._head = None

    def _await_head(self) -> None:
        """A head that comes byte by byte has no more time than any other."""
        self._head = self._head or self.loop.call_later(HEAD_S, self.transport.abort)

    def pause_writing(self) -> None:
        """The reader is slower than what it is sent."""
        super().pause_writing()
        self._unread = self._unread or self.loop.call_later(UNREAD_S, self.transport.abort)

    def resume_writing(self) -> None:
        """It has caught up."""
        super().resume_writing()
        _cancel(self._unread)
        self._unread = None

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002 - as in uvicorn
        """What came is no HTTP, or its head is too long."""
        refusal = RefusalError(400, Cause.of("head_wrong", limit=MOST_HEAD_BYTES)).response("en")
        headers = [*refusal.raw_headers, (b"connection", b"close")]
        try:
            for event in (Response(status_code=400, headers=headers), Data(data=bytes(refusal.body)), EndOfMessage()):
                self.transport.write(self.conn.send(event) or b"")
            self.transport.close()
        except LocalProtocolError:  # in the middle of an answer
            self.transport.abort()


def _cancel(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()
