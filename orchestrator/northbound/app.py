"""All addresses of the page's server, who may use each, and what answers there."""

import json
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route, Router

from orchestrator.config.northbound import Role
from orchestrator.errors import CauseError
from orchestrator.model import Cause
from orchestrator.northbound.accounts import Accounts, with_cookie
from orchestrator.northbound.asking import HALTS, Asking
from orchestrator.northbound.fields import number_field
from orchestrator.northbound.refusal import JSON, RefusalError, language_of_request
from orchestrator.northbound.sessions import Me
from orchestrator.northbound.static import Static
from orchestrator.northbound.stream import Streams, sent
from orchestrator.northbound.told import asked_language, encoded

#: Larger than any revision.
MOST_REVISION = 10**15
#: The page's own addresses: one file answers at all of them.
PAGES = ("/", "/bay/{bay}", "/history", "/batteries", "/station", "/login")

STREAM = {"content-type": "text/event-stream; charset=utf-8", "cache-control": "no-store", "vary": "accept-encoding"}

Answer = Callable[[Request, Me], Awaitable[Response]]


def json_response(value: object, status: int = 200) -> Response:
    """As JSON that nobody keeps."""
    return Response(encoded(value), status, JSON)


def language(request: Request) -> str:
    """The reader's, for sentences that are made here."""
    return language_of_request(request.query_params.get("language"), request.scope["headers"])


async def json_object(request: Request) -> Mapping[str, object]:
    """The body, which is one JSON object; RefusalError otherwise."""
    try:
        value = json.loads(await request.body())
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, dict):
        raise RefusalError(400, Cause("request_no_object"))
    return value


@dataclass(frozen=True, slots=True)
class App:
    """What the addresses need."""

    accounts: Accounts
    streams: Streams
    asking: Asking
    static: Static
    more: tuple[tuple[str, Role, Answer], ...] = ()  #: further addresses that are only read

    def router(self) -> Router:
        """The addresses; each of the API but those for logging in needs a role."""
        page, api = self.static.index, "/api"
        reads = (
            (f"{api}/stream", Role.VIEWER, self.stream),
            (f"{api}/status", Role.VIEWER, self.status),
            *self.more,
        )
        routes = [
            *(Route(path, page, methods=["GET"]) for path in PAGES),
            Route("/static/{path:path}", self.static.file, methods=["GET"]),
            *(Route(path, self._for(role, answer), methods=["GET"]) for path, role, answer in reads),
            Route(f"{api}/request", self._for(Role.OPERATOR, self.request), methods=["POST"]),
            Route(f"{api}/me", self.me, methods=["GET"]),
            Route(f"{api}/login", self.login, methods=["POST"]),
            Route(f"{api}/logout", self.logout, methods=["POST"]),
        ]
        return Router(routes, redirect_slashes=False)

    def _for(self, role: Role, answer: Answer) -> Callable[[Request], Awaitable[Response]]:
        """The same for those who have this role; RefusalError for others."""

        async def guarded(request: Request) -> Response:
            try:
                return await answer(request, self.accounts.need(request, role))
            except CauseError as error:
                raise error if isinstance(error, RefusalError) else RefusalError(503, error.cause) from None

        return guarded

    async def stream(self, request: Request, _me: Me) -> Response:
        """The live stream; goes on after `Last-Event-ID`."""
        after = request.headers.get("last-event-id", "")
        seen = number_field({"after": after} if after.isdigit() else {}, "after", MOST_REVISION, 0)
        self.streams.check_room()
        events = self.streams.events(seen, self._asked(request), lambda: self._me(request))
        packed = "gzip" in request.headers.get("accept-encoding", "")
        headers = {**STREAM, **({"content-encoding": "gzip"} if packed else {})}
        return StreamingResponse(sent(events, packed=packed), headers=headers)

    async def status(self, request: Request, _me: Me) -> Response:
        """The long poll."""
        seen = number_field(request.query_params, "after", MOST_REVISION, 0)
        text = await self.streams.poll(seen, self._asked(request), lambda: self._me(request))
        return Response(text, headers=JSON)

    async def request(self, request: Request, me: Me) -> Response:
        """Start, pause, stop or reset a bay."""
        address = request.client.host if request.client else ""
        asked = await json_object(request)
        if asked.get("action") not in HALTS:
            self.accounts.check_trust()
        answer = await self.asking.request(asked, me, address, language(request), request.is_disconnected)
        return json_response(answer)

    async def me(self, request: Request) -> Response:
        """Who is logged in, and whether one has to be."""
        return json_response({"me": self._me(request), "login": self.accounts.needed})

    async def login(self, request: Request) -> Response:
        """Begin a session."""
        me, cookie = await self.accounts.login(await json_object(request), request)
        return with_cookie(json_response({"ok": True, "me": me.fields}), cookie)

    async def logout(self, request: Request) -> Response:
        """End it."""
        return with_cookie(json_response({"ok": True}), self.accounts.logout(request))

    def _me(self, request: Request) -> Mapping[str, str] | None:
        me = self.accounts.me(request)
        return me.fields if me is not None else None

    @staticmethod
    def _asked(request: Request) -> str:
        return asked_language(request.query_params.get("language"))
