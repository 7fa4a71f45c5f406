"""The person behind a request: the user at the other end of the socket, for whom root acts, and why.

A program that passes on what others want says who they are, in `by`. Nobody vouches for that but the program: it stands
beside the program's own user, and never instead of it.
"""

import pwd
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache

from orchestrator.core.memory import Operator
from orchestrator.core.operator import NAMED
from orchestrator.core.persisted import TimedStart
from orchestrator.lastresort.signing import one_line
from orchestrator.model import Cause, Request
from orchestrator.model.cause import parts, together

ROOT = 0
#: What a person's request becomes in the core.
BECOMES = {
    Request.STOP: "stopped_by",
    Request.PAUSE: "paused_by",
    Request.RESET: "reset_by",
    Request.START: "started_by",
}


@cache
def user_name(uid: int) -> str:
    """The user's name. Asked of the system once: a directory service may take its time, and no stop waits for it."""
    try:
        return pwd.getpwuid(uid).pw_name
    except (KeyError, OSError):
        return f"uid {uid}"


@dataclass(frozen=True, slots=True)
class Asker:
    """Who makes a request, and why; without a `uid`, nobody knows."""

    uid: int | None = None  #: by the kernel's word
    behind: str = ""  #: the person who became root by sudo: only root is believed
    because: str = ""
    by: str = ""  #: whose wish it is, by the word of the program that asks: door, user, address
    estop: bool = False  #: by way of `orchestrator estop`
    unix_s: float = field(default=0.0, compare=False)

    @classmethod
    def of(cls, request: Mapping[str, object], unix_s: float) -> "Asker":
        """The asker of a request; `uid` was added to it by the control socket."""
        uid = request.get("uid")
        known = uid if isinstance(uid, int) else None
        behind = _text(request.get("sudo_user")) if known == ROOT else ""
        estop = request.get("means") == "estop"
        behind = "" if behind == user_name(ROOT) else behind
        return cls(known, behind, _text(request.get("because")), _text(request.get("by")), estop, unix_s)

    @property
    def person(self) -> str | Cause:
        """The person, however it asks; "" if unknown. What a program passes on is another's than its own."""
        return self.who if self.by else self._user

    @property
    def _user(self) -> str:
        return self.behind or ("" if self.uid is None else user_name(self.uid))

    @property
    def who(self) -> str | Cause:
        """For people: "kim", "root for kim", or "northbound for page, lee, 10.0.0.7"."""
        who: str | Cause = self._user
        if self.uid is not None and self.behind:
            who = Cause.of("on_behalf", user=user_name(self.uid), person=self.behind)
        return Cause.of("passed_on", user=who, by=self.by) if self.by else who

    def cause(self, request: Request, target_pct: float | None = None) -> Cause | None:
        """What the request becomes, a start with the target of its one charge; None if nobody knows who makes it."""
        if self.uid is None:
            return None
        id_ = "estopped_by" if self.estop and request is Request.STOP else BECOMES[request]
        because = {"because": self.because} if self.because else {}
        cause = Cause.of(id_, who=self.who, asked_unix_s=self.unix_s, **because)
        return cause if target_pct is None else replace(cause.with_(target_pct=target_pct), id="started_to_by")


NOBODY = Asker()  #: known


def _text(value: object) -> str:
    return one_line(value) if isinstance(value, str) else ""


def started_later(timed: TimedStart) -> Cause | None:
    """Who has asked for a start whose time has come, as the core takes it."""
    if timed.by is None:
        return None
    told = timed.by.with_(start_unix_s=timed.start_unix_s)
    if timed.target_pct is None:
        return replace(told, id="started_later_by")
    return replace(told.with_(target_pct=timed.target_pct), id="started_later_to_by")


def held_by_others(operator: Operator, person: str | Cause) -> Cause | None:
    """The stops and pauses of others than this person that hold a bay; None if there are none."""
    holds = [one for hold in (operator.hold, operator.paused_by) if hold is not None for one in parts(hold)]
    others = [one for one in holds if one.id in NAMED and _person(one.param("who")) != person]
    return together(others) if others else None


def _person(who: object) -> object:
    return who.param("person") if isinstance(who, Cause) and who.id == "on_behalf" else who
