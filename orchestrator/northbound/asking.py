"""A person's request at the page, handed to the controller with who asks. The controller decides; nothing here does."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any, cast

from orchestrator.errors import NoServiceError, ServiceError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.northbound.fields import shown_field, text_field
from orchestrator.northbound.pulse import Pulse
from orchestrator.northbound.refusal import RefusalError
from orchestrator.northbound.sessions import Me
from orchestrator.northbound.told import encoded
from orchestrator.northbound.work import Workers
from orchestrator.text.catalogue import say
from orchestrator.text.document import refusals, said

ACTIONS = ("start", "pause", "stop", "reset")
#: What an operator may do whatever is in doubt.
HALTS = ("pause", "stop")
#: These set something going: carried out late, they would charge a battery that somebody has stopped meanwhile.
PROMPT = frozenset({"start", "reset"})
#: How long such a request may wait here, and how long the controller may take to tell how the bay is.
LATE_S, LOOK_S = 2.0, 1.5
#: A request and the end of its connection may lie here side by side: so long until both are read.
GONE_S = 0.05
#: The moment of a change is computed anew each second from two clocks, so the same one may differ by this.
SAME_S = 0.05
#: What an answer that is none ends in here, whatever the controller has sent.
NONSENSE = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
#: The service answers within 10 s, or says that the bays do not.
ANSWER_S = 11.0
#: The longest name and reason.
NAME, REASON = 64, 200
#: What the journal calls this way in.
DOOR = "page"


class Asking:
    """Hands requests to the controller's operator socket."""

    def __init__(self, socket: Callable[[], Path], pulse: Pulse) -> None:
        self._socket, self._pulse = socket, pulse
        self._workers = Workers("asking", 8, 24)

    async def request(
        self, asked: Mapping[str, object], me: Me, address: str, language: str, gone: Callable[[], Awaitable[bool]]
    ) -> dict[str, Any]:
        """What the controller answers to `{"action", "bay", "because", "since"}`. RefusalError if nobody answers.

        `gone` tells whether whoever asked has left meanwhile.
        """
        come_s = monotonic()
        action, bay = text_field(asked, "action", 16), text_field(asked, "bay", NAME)
        if action not in ACTIONS:
            raise RefusalError(400, Cause.of("field_wrong", name="action", wanted="|".join(ACTIONS)))
        because, since_s = text_field(asked, "because", REASON, default=""), shown_field(asked, "since")
        if action in PROMPT:
            await asyncio.sleep(GONE_S)
            if await gone():
                raise RefusalError(503, Cause("asker_gone"))
        request: dict[str, object] = {
            "verb": action,
            "bays": [bay],
            "by": ", ".join(filter(None, (DOOR, me.name, address))),
            **({"because": because} if because else {}),
        }
        try:
            return await self._answer(request, bay, since_s, come_s, language)
        except OSError as error:  # the station file cannot be read
            why: object = error.strerror or str(error)
        except ServiceError as error:
            told = error.told.get("params") if isinstance(error.told, Mapping) else None
            why = (told.get("reason") if isinstance(told, Mapping) else None) or str(error)
        except NONSENSE:
            why = Cause("answer_odd")
        raise RefusalError(503, Cause.of("controller_silent", why=why))

    async def _answer(
        self, request: Mapping[str, object], bay: str, since_s: float | None, come_s: float, language: str
    ) -> dict[str, Any]:
        """What the controller says, as the page is told it; one of NONSENSE if that is no answer."""
        action = str(request["verb"])
        told: dict[str, Any] = {"ok": False, "action": action, "bay": bay}
        try:
            answer = await self._workers.do(self._passed_on, request, bay, since_s, come_s)
        except ServiceError as error:
            if isinstance(error, NoServiceError) or not isinstance(error.told, Mapping):
                raise
            told |= {"text": said(error.told, str(error), language), "cause": error.told}
        else:
            refused = refusals(answer, language)[bay]
            if not isinstance(refused, str):
                raise TypeError(refused)
            text = refused or say(Cause.of("accepted", bay=bay, verb=action), language)
            cause = cast("Mapping[str, object]", answer.get("causes") or {}).get(bay)
            told |= {"ok": not refused, "text": text, "cause": cause}
        encoded(told)  # which may be what no browser can read
        return told

    def _passed_on(
        self, request: Mapping[str, object], bay: str, since_s: float | None, come_s: float
    ) -> dict[str, object]:
        """The controller's answer; RefusalError if this would set something going that nobody may want any more."""
        path = self._socket()
        if request["verb"] in PROMPT:
            if since_s is not None and not _as_shown(ask(path, {"verb": "status", "bay": bay}, LOOK_S), bay, since_s):
                raise RefusalError(409, Cause.of("bay_changed", bay=bay))
            if self._pulse.stood_still or monotonic() - come_s > LATE_S:
                raise RefusalError(503, Cause("page_stood_still"))
        return ask(path, request, ANSWER_S)


def _as_shown(document: Mapping[str, Any], bay: str, since_s: float) -> bool:
    """Whether the bay is still as it was when its entry had this `since`."""
    now_s = next((one["since"] for one in document["bays"] if one["name"] == bay), None)
    return isinstance(now_s, int | float) and abs(now_s - since_s) <= SAME_S
