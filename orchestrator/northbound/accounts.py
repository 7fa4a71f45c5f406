"""Logging in and out, and who is at the door. Without a users file, everybody on this machine is an operator."""

import asyncio
from collections.abc import Callable, Mapping

from starlette.requests import Request
from starlette.responses import Response

from orchestrator.config.northbound import Role, User
from orchestrator.model import Cause
from orchestrator.northbound.backoff import Backoff
from orchestrator.northbound.fields import text_field
from orchestrator.northbound.password import LONGEST, matches, nobodys
from orchestrator.northbound.refusal import RefusalError
from orchestrator.northbound.sessions import LASTS_S, LOCAL, Me, Sessions
from orchestrator.northbound.users import Users
from orchestrator.northbound.work import Workers

#: The longest name.
NAME = 64
COOKIE = "orchestrator_session"
#: The most logins that wait for their turn.
MOST_WAITING = 16

Counts = tuple[tuple[Backoff, str], ...]  #: the failures of the name, and of the address


class Accounts:
    """The users, their sessions, and failed logins. `clock` tells monotonic seconds, `say` is told who logs in."""

    def __init__(
        self, users: Users | None, clock: Callable[[], float], say: Callable[[Cause], None], *, secure: bool
    ) -> None:
        self._users, self._clock, self._say, self._secure = users, clock, say, secure
        self._sessions = Sessions(users) if users is not None else None
        # Browsers send such a name back only over TLS, only to this host, and let no other host set it.
        self._cookie = f"__Host-{COOKIE}" if secure else COOKIE
        # One at a time: a hash takes 16 MiB, and each attempt knows of the failures before it.
        self._workers, self._turn, self._waiting = Workers("login", 1, 0), asyncio.Lock(), 0
        self._names, self._addresses = Backoff(free=10, longest_s=10.0), Backoff(free=5, longest_s=60.0)

    @property
    def needed(self) -> bool:
        """Whether one has to log in."""
        return self._sessions is not None

    def me(self, request: Request) -> Me | None:
        """Who makes this request; None if nobody knows."""
        if self._sessions is None or self._users is None:
            return LOCAL
        self._look()
        id_ = request.cookies.get(self._cookie)
        return self._sessions.me(id_, self._clock()) if id_ else None

    def need(self, request: Request, role: Role) -> Me:
        """Who makes this request; RefusalError if that is nobody who may."""
        me = self.me(request)
        if me is None:
            raise RefusalError(401, Cause("login_needed"))
        if role is Role.OPERATOR and me.role is not Role.OPERATOR:
            raise RefusalError(403, Cause.of("role_too_low", name=me.name))
        return me

    def check_trust(self) -> None:
        """RefusalError while nobody can tell who may do what: then nobody logs in, and nothing is set going."""
        if self._users is not None and self._users.doubtful:
            raise RefusalError(503, Cause("users_unsure"))

    async def login(self, asked: Mapping[str, object], request: Request) -> tuple[Me, str]:
        """The user, and the cookie of a new session; RefusalError for anybody else."""
        if self._sessions is None or self._users is None:
            raise RefusalError(409, Cause("login_none"))
        name, password = text_field(asked, "name", NAME), text_field(asked, "password", LONGEST)
        self._look()
        self.check_trust()
        address = request.client.host if request.client else ""
        counts = ((self._names, name), (self._addresses, address))
        self._check_wait(counts)
        if self._waiting >= MOST_WAITING:
            raise RefusalError(503, Cause("page_busy"), {"retry-after": "2"})
        self._waiting += 1
        try:
            async with self._turn:
                self._check_wait(counts)
                user = await self._known(name, password, counts)
                self.check_trust()  # the file may have changed meanwhile
        finally:
            self._waiting -= 1
        self._say(Cause.of("login_done", name=name, role=user.role.value, address=address))
        self.logout(request)  # a session from before the login is worth nothing after it
        id_ = self._sessions.begin(name, user, self._clock())
        return Me(name, user.role), self._set(id_, int(LASTS_S))

    def logout(self, request: Request) -> str:
        """End the session; returns the cookie that forgets it."""
        if self._sessions is not None and (id_ := request.cookies.get(self._cookie)):
            self._sessions.end(id_)
        return self._set("", 0)

    def _look(self) -> None:
        """Whoever is gone from the file, or has a new password, is logged out, even if he comes back."""
        if self._users is not None and self._sessions is not None and self._users.look():
            self._sessions.drop_strangers()

    async def _known(self, name: str, password: str, counts: Counts) -> User:
        """The user who has this password; RefusalError otherwise."""
        user = self._users.get(name) if self._users is not None else None
        told = user.password if user is not None else nobodys()
        well = await self._workers.do(matches, password, told)
        if user is not None and well:
            for count, who in counts:
                count.succeeded(who)
            return user
        for count, who in counts:
            count.failed(who, self._clock())
        self._say(Cause.of("login_failed", name=name, address=counts[1][1]))
        raise RefusalError(401, Cause("login_wrong"))

    def _check_wait(self, counts: Counts) -> None:
        """RefusalError while too many attempts have failed."""
        wait_s = max(count.wait_s(who, self._clock()) for count, who in counts)
        if wait_s > 0:
            raise RefusalError(429, Cause.of("login_wait", wait_s=wait_s), {"retry-after": str(int(wait_s) + 1)})

    def _set(self, value: str, age_s: int) -> str:
        secure = "; Secure" if self._secure else ""
        return f"{self._cookie}={value}; Max-Age={age_s}; Path=/; HttpOnly; SameSite=Strict{secure}"


def with_cookie(response: Response, cookie: str) -> Response:
    """The response, and the browser keeps this."""
    response.headers.append("set-cookie", cookie)
    return response
