"""A person's request at the page, handed to the controller with who asks. The controller decides; nothing here does."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from orchestrator.errors import NoServiceError, ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.northbound.fields import text_field
from orchestrator.northbound.refusal import RefusalError
from orchestrator.northbound.sessions import Me
from orchestrator.northbound.work import Workers
from orchestrator.text.catalogue import say
from orchestrator.text.document import refusals, said

ACTIONS = ("start", "pause", "stop", "reset")
#: The service answers within 10 s, or says that the bays do not.
ANSWER_S = 11.0
#: The longest name and reason.
NAME, REASON = 64, 200
#: What the journal calls this way in.
DOOR = "page"


class Asking:
    """Hands requests to the controller's operator socket."""

    def __init__(self, socket: Callable[[], Path]) -> None:
        self._socket = socket
        self._workers = Workers("asking", 8, 24)

    async def request(self, asked: Mapping[str, object], me: Me, address: str, language: str) -> dict[str, Any]:
        """What the controller answers to `{"action", "bay", "because"}`. RefusalError if nobody answers."""
        action, bay = text_field(asked, "action", 16), text_field(asked, "bay", NAME)
        if action not in ACTIONS:
            raise RefusalError(400, Cause.of("field_wrong", name="action", wanted="|".join(ACTIONS)))
        because = text_field(asked, "because", REASON, default="")
        request: dict[str, object] = {
            "verb": action,
            "bays": [bay],
            "by": ", ".join(filter(None, (DOOR, me.name, address))),
            **({"because": because} if because else {}),
        }
        try:
            answer = await self._workers.do(ask, self._socket(), request, ANSWER_S)
        except OSError as error:  # the station file cannot be read
            raise RefusalError(503, Cause.of("controller_silent", why=error.strerror or str(error))) from None
        except NoServiceError as error:
            told = error.told.get("params") if isinstance(error.told, Mapping) else None
            why = told.get("reason") if isinstance(told, Mapping) else None
            raise RefusalError(503, Cause.of("controller_silent", why=why or str(error))) from None
        except ServiceError as error:
            text = said(error.told, str(error), language)
            return {"ok": False, "action": action, "bay": bay, "text": text, "cause": error.told}
        refused = refusals(answer, language).get(bay, "")
        text = refused or say(Cause.of("accepted", bay=bay, verb=action), language)
        causes = answer.get("causes")
        cause = causes.get(bay) if isinstance(causes, Mapping) else None
        return {"ok": not refused, "action": action, "bay": bay, "text": text, "cause": cause}
