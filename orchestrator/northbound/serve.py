"""`orchestrator serve`: the page of a station, in a process of its own, which knows the controller by its sockets."""

import asyncio
import errno
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
from orchestrator.northbound.pulse import Pulse
from orchestrator.northbound.record_doors import RecordDoors
from orchestrator.northbound.server import BACKLOG, PageServer, run
from orchestrator.northbound.static import Static
from orchestrator.northbound.stream import Streams
from orchestrator.northbound.users import Users
from orchestrator.show import own_language
from orchestrator.text.catalogue import say


def serve(file: str) -> int:
    """Serve until told to end; the first line says where."""
    northbound = load_northbound(file)
    context = certificate(northbound.page.tls) if northbound.page.tls is not None else None
    listener = listening(Listen.of(northbound.page.listen))
    print(say(Cause.of("page_served", address=address_of(listener, context)), own_language()), flush=True)

    def on_hangup() -> None:
        if northbound.page.tls is not None and context is not None:
            reload_certificate(context, northbound.page.tls)

    async def go_on() -> None:
        server, link = assembled(northbound, listener, context)
        await run(server, link.run(), on_hangup)

    asyncio.run(go_on())
    sys.stdout.flush()
    os._exit(0)  # at once: no thread that still reads the record is waited for


def assembled(
    northbound: Northbound, listener: socket.socket, context: ssl.SSLContext | None
) -> tuple[PageServer, Link]:
    """The server, and its link to the controller, which is to run beside it. Belongs to the event loop."""
    station = northbound.station
    users = Users(northbound.users, tell) if northbound.users is not None else None
    link = Link(lambda: sockets(station))
    accounts = Accounts(users, time.monotonic, tell, secure=context is not None)
    records = RecordDoors(lambda: journal(station), tell, own_directory()).doors()
    closely = Closely(lambda: sockets(station)).door()
    pulse = Pulse()
    pulse.begin()
    asking = Asking(lambda: sockets(station)[-1], pulse)
    app = App(accounts, Streams(link), asking, Static(), (*records, closely))
    door = Door.of(Listen.of(northbound.page.listen).host, northbound.page.hosts)
    return PageServer(Guard(app.router(), door, tell), listener, context), link


def address_of(listener: socket.socket, context: ssl.SSLContext | None) -> str:
    """What is to be typed into a browser."""
    host, port = listener.getsockname()[:2]
    return f"{'http' if context is None else 'https'}://{f'[{host}]' if ':' in host else host}:{port}/"


def sockets(station: Path) -> list[Path]:
    """The sockets of the station's service: that for looking, if it has one, then that for requests."""
    found = wiring(station)
    return [*([Path(found.view_socket)] if found.view_socket else []), _named(station, found.socket)]


def journal(station: Path) -> Path:
    """The journal of the station's service."""
    return _named(station, wiring(station).journal)


def own_directory() -> Path | None:
    """Where this process may keep something, as systemd says: it may not write beside the records of the service."""
    found = os.environ.get("STATE_DIRECTORY")
    return Path(found) if found else None


def _named(station: Path, path: str) -> Path:
    if not path:  # the file is damaged
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(station))
    return Path(path)


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
        certificate(tls)  # a context that cannot take all of it would lose what it has
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
