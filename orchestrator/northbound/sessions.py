"""Who is logged in. Sessions live in memory: a restart of this process ends them all."""

import hashlib
import secrets
from dataclasses import dataclass

from orchestrator.config.northbound import Role, User
from orchestrator.northbound.users import Users

#: A session ends after this, whatever is done in it.
LASTS_S = 12 * 3600.0
#: The most sessions at once, and of one user; another one ends the oldest.
MOST, MOST_OF_ONE = 256, 16


@dataclass(frozen=True, slots=True)
class Me:
    """Somebody at a door."""

    name: str
    role: Role

    @property
    def fields(self) -> dict[str, str]:
        """As JSON."""
        return {"name": self.name, "role": self.role.value}


#: Everybody on this machine, where there are no users.
LOCAL = Me("", Role.OPERATOR)


@dataclass(frozen=True, slots=True)
class Session:
    """One login."""

    name: str
    password: str  #: the hash that was logged in with: a new password ends the session
    end_s: float


class Sessions:
    """Sessions by the digest of their ids: a copy of this memory logs nobody in. Time is given."""

    def __init__(self, users: Users) -> None:
        self._users = users
        self._sessions: dict[str, Session] = {}

    def begin(self, name: str, user: User, now_s: float) -> str:
        """A session; returns its id, which nobody has had before."""
        self._drop(now_s)
        own = [key for key, one in self._sessions.items() if one.name == name]
        too_many = (own, MOST_OF_ONE), (list(self._sessions), MOST)
        for key in {key for keys, most in too_many for key in keys[: max(len(keys) + 1 - most, 0)]}:
            del self._sessions[key]
        id_ = secrets.token_urlsafe(32)
        self._sessions[_key(id_)] = Session(name, user.password, now_s + LASTS_S)
        return id_

    def me(self, id_: str, now_s: float) -> Me | None:
        """Who has this session; None if there is none, or if it has ended."""
        session = self._sessions.get(_key(id_))
        user = self._user(session) if session is not None else None
        if session is None or user is None or now_s >= session.end_s:
            return None
        return Me(session.name, user.role)

    def end(self, id_: str) -> None:
        """Log out."""
        self._sessions.pop(_key(id_), None)

    def drop_strangers(self) -> None:
        """End the sessions of those who are no users any more."""
        self._sessions = {key: one for key, one in self._sessions.items() if self._user(one) is not None}

    def _user(self, session: Session) -> User | None:
        """Whose session it is, as long as he has the password that he logged in with."""
        user = self._users.get(session.name)
        return user if user is not None and user.password == session.password else None

    def _drop(self, now_s: float) -> None:
        self._sessions = {key: one for key, one in self._sessions.items() if now_s < one.end_s}


def _key(id_: str) -> str:
    return hashlib.sha256(id_.encode("utf-8", "replace")).hexdigest()
