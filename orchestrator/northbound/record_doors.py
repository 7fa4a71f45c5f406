"""The addresses of the record."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from orchestrator.config.northbound import Role
from orchestrator.model import Cause
from orchestrator.northbound.app import Answer, language
from orchestrator.northbound.records import Records
from orchestrator.northbound.refusal import JSON
from orchestrator.northbound.sessions import Me
from orchestrator.northbound.told import encoded
from orchestrator.northbound.work import Workers

CSV = {
    "content-type": "text/csv; charset=utf-8",
    "content-disposition": 'attachment; filename="charges.csv"',
    "cache-control": "no-store",
}


class RecordDoors:
    """Answers from the records beside a journal, two readers at a time: nothing else waits for them."""

    def __init__(self, journal: Callable[[], Path], say: Callable[[Cause], None], home: Path | None = None) -> None:
        self._records, self._workers = Records(journal, say, home), Workers("record", 2, 14)

    def doors(self) -> tuple[tuple[str, Role, Answer], ...]:
        """Address, least role, and what answers."""
        records = self._records
        found: tuple[tuple[str, Callable[[Request], Any]], ...] = (
            ("sessions", lambda request: records.sessions(request.query_params, language(request))),
            ("sessions/{id}", lambda request: records.session(request.path_params["id"], language(request))),
            ("batteries", lambda _: records.batteries()),
            ("batteries/{id:path}", lambda request: records.battery(request.path_params["id"], language(request))),
            ("events", lambda request: records.events(request.query_params, language(request))),
        )
        json = ((f"/api/{path}", Role.VIEWER, self._json(what)) for path, what in found)
        return (*json, ("/api/sessions.csv", Role.VIEWER, self._csv))

    def _json(self, what: Callable[[Request], Any]) -> Answer:
        async def answer(request: Request, _me: Me) -> Response:
            # A curve is long: encoding it would hold up the live streams.
            return Response(await self._workers.do(lambda: encoded(what(request))), headers=JSON)

        return answer

    async def _csv(self, request: Request, _me: Me) -> Response:
        text = await self._workers.do(self._records.csv, request.query_params, language(request))
        return Response(text, headers=CSV)
