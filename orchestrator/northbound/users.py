"""Who may log in: the users file, read again when it changes."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

from orchestrator.config.load import load_users
from orchestrator.config.northbound import User
from orchestrator.config.northbound_rules import file_problem
from orchestrator.errors import ConfigError
from orchestrator.model import Cause

Stamp = tuple[int, int, int]


class Users:
    """The users in a file. A file that cannot be read any more changes nothing, and `say` is told why."""

    def __init__(self, path: Path, say: Callable[[Cause], None]) -> None:
        self._path, self._say = path, say
        self._stamp = _stamp(path)
        self._users: Mapping[str, User] = load_users(path).users

    def get(self, name: str) -> User | None:
        """The user with this name."""
        return self._users.get(name)

    def look(self) -> None:
        """Read the file again if it is another one."""
        stamp = _stamp(self._path)
        if stamp == self._stamp:
            return
        self._stamp = stamp
        if problem := file_problem(self._path, secret=True):
            self._say(Cause.of("users_kept", why=problem))
            return
        try:
            self._users = load_users(self._path).users
        except ConfigError as error:
            self._say(Cause.of("users_kept", why=str(error)))


def _stamp(path: Path) -> Stamp:
    try:
        found = os.stat(path)  # noqa: PTH116 - as short
    except OSError:
        return (0, 0, 0)
    return found.st_ino, found.st_mtime_ns, found.st_size
