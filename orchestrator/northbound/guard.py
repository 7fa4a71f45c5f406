"""Stands before everything that the server answers: the door, limits on body and time, headers, and no tracebacks."""

import asyncio
from collections.abc import Callable
from urllib.parse import parse_qs

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from orchestrator.model import Cause
from orchestrator.northbound.door import Door
from orchestrator.northbound.refusal import Header, RefusalError, language_of_request

#: The longest request body, and how long it may take to arrive.
MOST_BYTES, BODY_S = 16 * 1024, 5.0
#: How long an answer may take, but for a stream; the long poll has to fit.
ANSWER_S = 40.0
STREAM = "/api/stream"
#: On every answer. Nothing from elsewhere, nothing inline, in nobody's frame.
HEADERS: tuple[Header, ...] = (
    (
        b"content-security-policy",
        b"default-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


class Guard:
    """An ASGI application around another one. `say` is told of errors of our own."""

    def __init__(self, app: ASGIApp, door: Door, say: Callable[[Cause], None]) -> None:
        self._app, self._door, self._say = app, door, say

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            return
        answer = _Answer(send)
        try:
            async with asyncio.timeout(None if scope["path"] == STREAM else ANSWER_S):
                self._door.check(scope["method"], scope["path"], scope["headers"], str((scope["server"] or ("",))[0]))
                if scope["method"] == "POST":
                    receive = _Read(await _body(receive), receive)
                await self._app({**scope, "app": self._app}, receive, answer)  # which makes starlette raise, not answer
        except HTTPException as error:
            await answer.refuse(_of_starlette(error, scope["method"]), scope, receive)
        except RefusalError as refusal:
            await answer.refuse(refusal, scope, receive)
        except TimeoutError:
            await answer.refuse(RefusalError(503, Cause("page_late")), scope, receive)
        except Exception as error:  # noqa: BLE001 - nobody outside is to see more of it than that there was one
            self._say(Cause.of("page_error", path=f"{scope['path']:.80}", error=f"{error!r:.400}"))
            await answer.refuse(RefusalError(500, Cause("page_failed")), scope, receive)


class _Answer:
    """Adds our headers, and knows whether anything was sent."""

    def __init__(self, send: Send) -> None:
        self._send, self._begun = send, False

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self._begun = True
            message = {**message, "headers": [*message.get("headers", ()), *HEADERS]}
        await self._send(message)

    async def refuse(self, refusal: RefusalError, scope: Scope, receive: Receive) -> None:
        """Tell why; an answer that has begun is broken off."""
        if not self._begun:
            asked = parse_qs(scope["query_string"].decode("latin-1")).get("language", [None])[0]
            await refusal.response(language_of_request(asked, scope["headers"]))(scope, receive, self)


class _Read:
    """Hands on a body that was read already, then whatever comes."""

    def __init__(self, body: bytes, receive: Receive) -> None:
        self._body: bytes | None = body
        self._receive = receive

    async def __call__(self) -> Message:
        if self._body is None:
            return await self._receive()
        body, self._body = self._body, None
        return {"type": "http.request", "body": body, "more_body": False}


def _of_starlette(error: HTTPException, method: str) -> RefusalError:
    """No such address, or another method."""
    if error.status_code == 405:
        return RefusalError(405, Cause.of("method_wrong", method=f"{method:.20}"), dict(error.headers or {}))
    return RefusalError(404, Cause("nothing_here"))


async def _body(receive: Receive) -> bytes:
    """The whole body. RefusalError if it is too long, or takes too long."""
    body = bytearray()
    try:
        async with asyncio.timeout(BODY_S):
            while True:
                message = await receive()
                if message["type"] != "http.request":
                    raise RefusalError(400, Cause.of("body_late", limit_s=BODY_S))
                body += message.get("body", b"")
                if len(body) > MOST_BYTES:
                    raise RefusalError(413, Cause.of("body_too_long", limit=MOST_BYTES), {"connection": "close"})
                if not message.get("more_body"):
                    return bytes(body)
    except TimeoutError:
        raise RefusalError(408, Cause.of("body_late", limit_s=BODY_S), {"connection": "close"}) from None
