"""A request that is refused: its status, and why in the reader's language. All errors look the same."""

from collections.abc import Iterable, Mapping

from starlette.responses import Response

from orchestrator.errors import CauseError
from orchestrator.model import Cause
from orchestrator.northbound.told import asked_language, encoded
from orchestrator.text.catalogue import fields, say

Header = tuple[bytes, bytes]
#: JSON, not to be kept by anybody in between.
JSON = {"content-type": "application/json; charset=utf-8", "cache-control": "no-store"}


class RefusalError(CauseError):
    """Told as JSON with this HTTP status."""

    def __init__(self, status: int, cause: Cause, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(cause)
        self.status, self.headers = status, headers or {}

    def response(self, language: str) -> Response:
        """What the reader gets."""
        told = {"ok": False, "error": self.cause.id, "text": say(self.cause, language)}
        body = encoded({**told, "cause": fields(self.cause, language)})
        return Response(body, self.status, {**JSON, **self.headers})


def language_of_request(query: str | None, headers: Iterable[Header]) -> str:
    """The language that a request asks for, by its query or else by its browser; English otherwise."""
    if language := asked_language(query):
        return language
    accepted = next((value for name, value in headers if name == b"accept-language"), b"")
    return asked_language(accepted[:2].decode("latin-1").lower()) or "en"
