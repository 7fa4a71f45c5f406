"""One bay looked at closely: its limits and its forecast, which cost too much to be told of every bay all the time."""

from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from orchestrator.config.northbound import Role
from orchestrator.errors import NoServiceError, ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.northbound.app import Answer, json_response, language
from orchestrator.northbound.asking import NAME, NONSENSE
from orchestrator.northbound.fields import text_field
from orchestrator.northbound.link import may_open
from orchestrator.northbound.refusal import RefusalError
from orchestrator.northbound.sessions import Me
from orchestrator.northbound.work import Workers
from orchestrator.text.document import in_language

#: However many look at a bay, the controller is asked about it no more often than this.
KEPT_S = 1.0
ANSWER_S = 5.0
#: As many bays are remembered.
MOST_KEPT = 64

Document = Mapping[str, Any]


class Closely:
    """Asks the service for the status of one bay, on the first of its `sockets` that is open to us."""

    def __init__(self, sockets: Callable[[], list[Path]]) -> None:
        self._sockets, self._workers = sockets, Workers("closely", 2, 14)
        self._kept: dict[str, tuple[float, Document]] = {}

    def door(self) -> tuple[str, Role, Answer]:
        """Address, least role, and what answers."""
        return "/api/bay", Role.VIEWER, self._answer

    async def _answer(self, request: Request, _me: Me) -> Response:
        bay = text_field(request.query_params, "bay", NAME)
        try:
            document = await self._workers.do(self._document, bay)
            (entry,) = in_language(document, language(request))["bays"]
            if entry["name"] != bay:
                raise ValueError(bay)
            return json_response(entry)
        except NONSENSE:
            raise RefusalError(503, Cause.of("bay_odd", bay=bay)) from None

    def _document(self, bay: str) -> Document:
        asked_s, document = self._kept.get(bay, (float("-inf"), {}))
        if monotonic() - asked_s < KEPT_S:
            return document
        try:
            paths = self._sockets()
            path = next((one for one in paths if may_open(one)), paths[-1])
            document = ask(path, {"verb": "status", "bay": bay}, ANSWER_S)
        except (NoServiceError, OSError) as error:
            raise RefusalError(503, Cause.of("no_journal", why=str(error))) from None
        except ServiceError as error:
            if not isinstance(error.told, Mapping):  # no refusal, but nonsense
                raise ValueError(bay) from None
            raise RefusalError(404, Cause("nothing_here")) from None
        if len(self._kept) >= MOST_KEPT:
            self._kept.clear()
        self._kept[bay] = monotonic(), document
        return document
