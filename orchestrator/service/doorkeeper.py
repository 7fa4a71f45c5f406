"""Who may use a socket of the service."""

import os
from collections.abc import Callable
from math import inf

from orchestrator.model import Cause
from orchestrator.service.client import Client

ROOT = 0
#: The shortest interval between reports of rejected users.
SAY_S = 60.0


class Doorkeeper:
    """Lets in the owner of the service and root. `say` informs people of others, now and then."""

    def __init__(self, say: Callable[[Cause], None]) -> None:
        self._say = say
        self._strangers, self._said_s = 0, -inf  # turned away since the last report

    def refusal(self, client: Client, now_s: float) -> Cause | None:
        """Why this client is turned away; None if it is let in."""
        pid, uid, _ = client.peer()
        if uid in (ROOT, os.getuid()):
            return None
        self._strangers += 1
        if now_s - self._said_s >= SAY_S:
            self._say(Cause.of("socket_stranger", uid=uid, pid=pid, times=self._strangers))
            self._strangers, self._said_s = 0, now_s
        return Cause("owner_only")
