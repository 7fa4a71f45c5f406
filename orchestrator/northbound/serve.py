"""`orchestrator serve`: the page of a station, in a process of its own, which knows the controller by its sockets."""

import asyncio
import os
import socket
import ssl
import sys
import time
from pathlib import Path

from orchestrator.config.load import load_northbound
from orchestrator.config.northbound import Northbound, Tls
from orchestrator.config.northbound_rules import Listen, file_problem
from orchestrator.config.ports import wiring
from orchestrator.errors import CauseError
from orchestrator.model import Cause
from orchestrator.northbound.accounts import Accounts
from orchestrator.northbound.app import App
from orchestrator.northbound.asking import Asking
from orchestrator.northbound.closely import Closely
from orchestrator.northbound.door import Door
from orchestrator.northbound.guard import Guard
from orchestrator.northbound.link import Link
from orchestrator.northbound.server import BACKLOG, PageServer, run
from orchestrator.northbound.static import Static
from orchestrator.northbound.stream import Streams
from orchestrator.northbound.users import Users
from orchestrator.show import own_language
from orchestrator.text.catalogue import say


def serve(file: str) -> int:
    """Serve until told to end; the first line says where."""
    northbound = load_northbound(file)
    listen = Listen.of(northbound.page.listen)
    context = certificate(northbound.page.tls) if northbound.page.tls is not None else None
    listener = listening(listen)
    asyncio.run(_serve(northbound, listen, listener, context))
    sys.stdout.flush()
    os._exit(0)  # at once: no thread that still reads the record is waited for


async def _serve(
    northbound: Northbound, listen: Listen, listener: socket.socket, context: ssl.SSLContext | None
) -> None:
    station, tls = northbound.station, northbound.page.tls
    users = Users(northbound.users, tell) if northbound.users is not None else None
    link = Link(lambda: sockets(station))
    accounts = Accounts(users, time.monotonic, secure=context is not None)
    closely = Closely(lambda: sockets(station)[0])
    app = App(accounts, Streams(link), Asking(lambda: sockets(station)[-1]), Static(), (closely.door(),))
    guard = Guard(app.router(), Door.of(listen.host, northbound.page.hosts), tell)
    scheme, port = "https" if context is not None else "http", listener.getsockname()[1]
    host = f"[{listen.host}]" if ":" in listen.host else listen.host
    print(say(Cause.of("page_served", address=f"{scheme}://{host}:{port}/"), own_language()), flush=True)

    def on_hangup() -> None:
        if tls is not None and context is not None:
            reload_certificate(context, tls)

    await run(PageServer(guard, listener, context), link.run(), on_hangup)


def sockets(station: Path) -> list[Path]:
    """The sockets of the station's service: that for looking, if it has one, then that for requests."""
    found = wiring(station)
    if not found.socket:
        raise FileNotFoundError(str(station))
    return [Path(found.socket)]


def tell(cause: Cause) -> None:
    """On standard error, which systemd keeps."""
    print(f"orchestrator: {say(cause, own_language())}", file=sys.stderr, flush=True)


def listening(listen: Listen) -> socket.socket:
    """A socket that listens there; CauseError if that cannot be."""
    family = socket.AF_INET6 if ":" in listen.host else socket.AF_INET
    try:
        return socket.create_server((listen.host, listen.port), family=family, backlog=BACKLOG)
    except OSError as error:
        address = f"{listen.host}:{listen.port}"
        raise CauseError(Cause.of("listen_failed", address=address, error=error.strerror or str(error))) from None


def certificate(tls: Tls) -> ssl.SSLContext:
    """The certificate with its key; CauseError if they are of no use."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    _load(context, tls)
    return context


def reload_certificate(context: ssl.SSLContext, tls: Tls) -> None:
    """Read the certificate again, for connections from now on."""
    try:
        _load(context, tls)
    except CauseError as error:
        tell(Cause.of("certificate_kept", why=error.cause))


def _load(context: ssl.SSLContext, tls: Tls) -> None:
    error: object = file_problem(tls.key_file, secret=True)
    if not error:
        try:
            context.load_cert_chain(tls.cert_file, tls.key_file, password=lambda: "")  # never ask at the terminal
        except OSError as failure:  # an SSLError is one
            error = getattr(failure, "reason", None) or failure.strerror or str(failure)
    if error:
        files = {"cert_file": str(tls.cert_file), "key_file": str(tls.key_file)}
        raise CauseError(Cause.of("certificate_wrong", error=error, **files))
