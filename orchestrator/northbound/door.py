"""Which requests are let in at all, by their head alone. Pure.

A page of somebody else must not be able to use this server by way of a browser here: neither by a form or a script that
sends a request (CSRF: `Origin`, the content type), nor by a name of its own that it lets point at this machine (DNS
rebinding: `Host`).
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from orchestrator.model import Cause
from orchestrator.northbound.refusal import Header, RefusalError

_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?")
#: Names of this machine that nobody else can have.
OWN = frozenset({"localhost", "127.0.0.1", "::1"})
READING = frozenset({"GET", "HEAD"})
API = "/api/"
#: Where a browser says that a request comes from.
SAME_SITE = frozenset({b"same-origin", b"none"})


@dataclass(frozen=True, slots=True)
class Door:
    """The names of this server, in lower case."""

    names: frozenset[str]

    @classmethod
    def of(cls, host: str, names: Iterable[str]) -> "Door":
        """The door of a server that listens at this address and has these names, too."""
        return cls(frozenset({host.lower(), *(name.lower().rstrip(".") for name in names)}) | OWN)

    def check(self, method: str, path: str, headers: Iterable[Header], address: str) -> None:
        """RefusalError, unless the request may come in; `address` is that of this server on its connection."""
        told = dict(headers)
        host = told.get(b"host", b"").decode("latin-1").lower()
        match = _HOST.fullmatch(host)
        name = match[1].strip("[]").rstrip(".") if match else ""
        if name not in self.names and (not name or name != address.lower()):
            raise RefusalError(421, Cause.of("host_unknown", host=f"{host:.80}" or "–"))
        if method not in READING and method != "POST":
            raise RefusalError(405, Cause.of("method_wrong", method=f"{method:.20}"), {"allow": "GET, HEAD, POST"})
        if path.startswith(API) or method == "POST":
            _check_origin(told, host)
        if method == "POST":
            _check_type(told)


def _check_origin(told: Mapping[bytes, bytes], host: str) -> None:
    """A browser names the page that a request is made by; other programs do not."""
    origin = told.get(b"origin")
    foreign = origin is not None and _netloc(origin) != host
    if foreign or told.get(b"sec-fetch-site", b"none") not in SAME_SITE:
        said = (origin or told.get(b"sec-fetch-site") or b"-").decode("latin-1")
        raise RefusalError(403, Cause.of("origin_foreign", origin=f"{said:.80}"))


def _netloc(origin: bytes) -> str:
    try:
        parts = urlsplit(origin.decode("latin-1").lower())
    except ValueError:
        return ""
    return parts.netloc if parts.scheme in ("http", "https") else ""


def _check_type(told: Mapping[bytes, bytes]) -> None:
    """A form of another page cannot send this type; a script has to ask first, and nobody here says yes."""
    type_ = told.get(b"content-type", b"").decode("latin-1")
    if type_.partition(";")[0].strip().lower() != "application/json":
        raise RefusalError(415, Cause.of("type_not_json", type=f"{type_:.80}" or "–"))
