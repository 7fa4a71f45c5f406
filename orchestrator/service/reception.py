"""Decides the order of answers at the control socket: a stop before everything that waits, one status for many.

A stop takes effect in the turn in which it is received. Requests waiting for the same bays were made before it, or may
have been, and are refused: a start must not be carried out after a stop that followed it. Identical stops share one
answer as long as nothing else was requested in between. A status is built once for all who ask at the same time; other
requests go to the bays one after another.
"""

import json
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import inf

from orchestrator.errors import CauseError
from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.service.client import Client
from orchestrator.text.catalogue import say

#: The maximum number of queries answered in one turn, so that stops are looked for in between.
TURN_QUESTIONS = 32
#: All who ask for the status within this get the same one.
SHARED_S = 0.02
#: The interval between requests other than stops, and the longest time that one may wait before it is refused.
PAUSE_S = 0.02
QUEUE_S = 2.0
#: The bays answer within this, or never.
ANSWER_S = 10.0

STOP, STATUS, WATCH = "stop", "status", "watch"

Answer = Mapping[str, object]
Same = tuple[int, bytes]  #: the user, and the request's line
Later = Callable[[], Answer | None]  #: returns the answer, None while there is none
Handler = Callable[[Mapping[str, object]], Answer | Later]
Reply = Callable[[Client, bytes, float], None]
OnRefused = Callable[[Mapping[str, object], Cause], None]  #: told of a request that is refused here


@dataclass(slots=True)
class Pending:
    """A request that the bays have not answered yet, and all its clients."""

    later: Later
    clients: list[Client]
    end_s: float


class Reception:
    """Takes complete requests, and calls `reply` once for each. Belongs to the control thread; nothing here blocks.

    `handler` must not block either: if an answer takes time, it returns a function to be polled for it.
    """

    def __init__(self, handler: Handler, reply: Reply, language: str, on_refused: OnRefused) -> None:
        self._handler, self._reply, self._language, self._on_refused = handler, reply, language, on_refused
        self._urgent: list[Client] = []
        self._questions: deque[Client] = deque()
        self._requests: deque[Client] = deque()
        self._request_s = -inf  # the earliest time for the next one to go to the bays
        self._pending: list[Pending] = []
        self._stops: dict[Same, Pending] = {}  # pending stops that identical ones may join
        self._shared: dict[bytes, bytes] = {}  # a status, by its request
        self._shared_s = -inf  # when the oldest of them was built

    @property
    def busy(self) -> bool:
        """Whether somebody is waiting for an answer."""
        return bool(self._pending or self._questions or self._requests or self._urgent)

    @property
    def stopping(self) -> set[Client]:
        """The clients whose requests are being carried out: they must not be dropped."""
        return {*self._urgent, *(client for pending in self._pending for client in pending.clients)}

    def take(self, client: Client, now_s: float) -> None:
        """Queue a client whose request is complete."""
        client.end_s = now_s + QUEUE_S + ANSWER_S
        verb = client.request.get("verb")
        (self._urgent if verb == STOP else self._questions if verb == STATUS else self._requests).append(client)

    def forget(self, client: Client) -> None:
        """Forget a client that has gone; a request already begun is still carried out."""
        for queue in (self._questions, self._requests):
            with suppress(ValueError):
                queue.remove(client)

    def work(self, now_s: float) -> None:
        """Handle every stop, then as much of the rest as fits into one turn."""
        urgent, self._urgent = self._urgent, []
        for client in urgent:
            self._overtake(client, now_s)
            self._begin_stop(client, now_s)
        for _ in range(min(len(self._questions), TURN_QUESTIONS)):
            self._tell_status(self._questions.popleft(), now_s)
        while self._requests and now_s - self._requests[0].heard_s > QUEUE_S:
            self._refuse(self._requests.popleft(), Cause("too_many_requests"), now_s)
        if self._requests and now_s >= self._request_s:
            self._request_s = now_s + PAUSE_S
            self._begin(self._requests.popleft(), now_s)
        self._look_for_answers(now_s)

    # --- by kind ---

    def _overtake(self, stop: Client, now_s: float) -> None:
        for client in [client for client in self._requests if _share_bays(client.request, stop.request)]:
            self._requests.remove(client)
            self._refuse(client, Cause("overtaken"), now_s)

    def _begin_stop(self, client: Client, now_s: float) -> None:
        same = client.uid, client.line
        if same in self._stops:
            self._stops[same].clients.append(client)
        elif (pending := self._handle(client, now_s)) is not None:
            self._stops[same] = pending

    def _begin(self, client: Client, now_s: float) -> None:
        self._stops.clear()  # a stop after this request differs from a stop before it
        self._handle(client, now_s)

    def _tell_status(self, client: Client, now_s: float) -> None:
        if now_s - self._shared_s > SHARED_S:
            self._shared.clear()
            self._shared_s = now_s
        if (text := self._shared.get(client.line)) is not None:
            self._reply(client, text, now_s)
        else:
            self._handle(client, now_s, shared=self._shared)

    def _handle(self, client: Client, now_s: float, shared: dict[bytes, bytes] | None = None) -> Pending | None:
        """Let the handler answer; returns the pending request if it will answer later."""
        if shared is None:
            self._shared.clear()  # the next status must show the effect of this request
        try:
            answer = self._handler(client.request)
        except CauseError as error:
            self._refuse(client, error.cause, now_s)
            return None
        except Exception as error:  # noqa: BLE001 - a request must never end the thread that answers them
            self._refuse(client, _internal(error), now_s)
            return None
        if callable(answer):
            pending = Pending(answer, [client], now_s + ANSWER_S)
            self._pending.append(pending)
            return pending
        text = encode({"ok": True, **answer})
        if shared is not None:
            shared[client.line] = text
        self._reply(client, text, now_s)
        return None

    def _look_for_answers(self, now_s: float) -> None:
        """Reply to the requests that the bays have answered by now."""
        for pending in tuple(self._pending):
            try:
                answer = pending.later()
            except Exception as error:  # noqa: BLE001 - as in `_handle`
                said = refused(_internal(error), self._language)
            else:
                if answer is None and now_s < pending.end_s:
                    continue
                late = refused(Cause("request_unanswered"), self._language)
                said = late if answer is None else {"ok": True, **answer}
            self._pending.remove(pending)
            self._stops = {same: one for same, one in self._stops.items() if one is not pending}
            text = encode(said)
            for client in pending.clients:
                self._reply(client, text, now_s)

    def _refuse(self, client: Client, why: Cause, now_s: float) -> None:
        self._on_refused(client.request, why)
        self._reply(client, encode(refused(why, self._language)), now_s)


def encode(answer: Answer) -> bytes:
    """An answer as one line."""
    return json.dumps(answer, ensure_ascii=False).encode(errors="backslashreplace") + b"\n"


def refused(why: Cause, language: str) -> Answer:
    """The answer that says no."""
    return {"ok": False, "error": say(why, language), "cause": plain(why)}


def _internal(error: Exception) -> Cause:
    return Cause.of("request_internal", error=repr(error))


def _share_bays(one: Mapping[str, object], other: Mapping[str, object]) -> bool:
    """Whether two requests may concern the same bay; null means all."""
    names, others = one.get("bays"), other.get("bays")
    return not isinstance(names, list) or not isinstance(others, list) or any(name in others for name in names)
