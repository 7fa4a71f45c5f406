"""Who may use a socket of the service: its owner and root, and, if it belongs to a group, the group's members.

Whether somebody is a member only the kernel knows: the socket's mode lets members connect, and nobody else.
"""

import grp
import os
import pwd
from collections.abc import Callable
from contextlib import suppress
from math import inf

from orchestrator.errors import StartError
from orchestrator.model import Cause
from orchestrator.service.asker import ROOT, user_name
from orchestrator.service.client import Client

#: The shortest interval between reports of rejected users.
SAY_S = 60.0


class Doorkeeper:
    """Lets people in. `say` informs people of others who have come, now and then."""

    def __init__(self, say: Callable[[Cause], None], group: str | None = None) -> None:
        self._say, self._group = say, group
        self._strangers, self._said_s = 0, -inf  # turned away since the last report

    def refusal(self, client: Client, now_s: float) -> Cause | None:
        """Why this client is turned away; None if it is let in."""
        pid, uid, _ = client.peer()
        if self._group is not None or uid in (ROOT, os.getuid()):
            return None
        self._strangers += 1
        if now_s - self._said_s >= SAY_S:
            self._say(Cause.of("socket_stranger", uid=uid, pid=pid, times=self._strangers))
            self._strangers, self._said_s = 0, now_s
        return Cause("owner_only")


def group_id(name: str) -> int:
    """The group's number. The names of its members are looked up, too: later no request has to wait for that."""
    try:
        group = grp.getgrnam(name)
    except (KeyError, OSError):
        raise StartError(Cause.of("group_unknown", group=name)) from None
    for member in group.gr_mem:
        with suppress(KeyError, OSError):
            user_name(pwd.getpwnam(member).pw_uid)
    return group.gr_gid
