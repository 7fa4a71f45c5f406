"""The HTTP server: uvicorn with our own connections, in this process and on one listener, until told to end."""

import asyncio
import contextlib
import logging
import signal
import socket
import ssl
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

from starlette.types import ASGIApp
from uvicorn import Config, Server
from uvicorn.protocols.http.h11_impl import H11Protocol

from orchestrator.northbound.connection import MOST_HEAD_BYTES, Connection

#: How long a connection may take for its handshake.
HANDSHAKE_S = 10.0
#: How many connections the kernel keeps for us.
BACKLOG = 128
#: How long a connection stays open without another request.
IDLE_S = 5


class PageServer(Server):
    """Serves `app` on a socket that listens already."""

    def __init__(self, app: ASGIApp, listener: socket.socket, context: ssl.SSLContext | None) -> None:
        logging.getLogger("uvicorn.error").disabled = True  # what a browser sends wrongly is nobody's business here
        super().__init__(
            Config(
                app, http=H11Protocol, loop="asyncio", ws="none", lifespan="off", interface="asgi3", log_config=None,
                access_log=False, proxy_headers=False, server_header=False, timeout_keep_alive=IDLE_S,
                timeout_graceful_shutdown=0, h11_max_incomplete_event_size=MOST_HEAD_BYTES,
            )
        )  # fmt: skip
        self._listener, self._context = listener, context
        self._crowd: dict[Connection, None] = {}

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:  # noqa: ARG002 - as in uvicorn
        """Accept connections."""
        server = await asyncio.get_running_loop().create_server(
            self._connection, sock=self._listener, backlog=BACKLOG, ssl=self._context,
            ssl_handshake_timeout=HANDSHAKE_S if self._context else None,
        )  # fmt: skip
        self.servers = [server]
        self.started = True

    def _connection(self) -> Connection:
        return Connection(self.config, self.server_state, self._crowd)

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Signals are the business of `run`."""
        yield


async def run(server: PageServer, beside: Coroutine[Any, Any, None], on_hangup: Callable[[], None]) -> None:
    """Serve until SIGTERM or SIGINT; `beside` runs meanwhile."""
    loop = asyncio.get_running_loop()

    def end() -> None:
        server.should_exit = True

    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, end)
    loop.add_signal_handler(signal.SIGHUP, on_hangup)
    task = loop.create_task(beside)
    try:
        await server.serve()
    finally:
        task.cancel()
