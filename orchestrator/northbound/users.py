"""Who may log in: the users file, read again when it changes."""

import os
from collections.abc import Callable
from pathlib import Path

from orchestrator.config.northbound import User
from orchestrator.config.northbound_rules import file_problem
from orchestrator.config.users_file import users_in
from orchestrator.errors import ConfigError
from orchestrator.model import Cause

Stamp = tuple[int, ...]

GONE: Stamp = ()


class Users:
    """The users in a file; a file that is not there any more names nobody. `say` is told what is wrong with it.

    If it cannot be relied on, `doubtful` is true and the users are those of before: nobody can tell who of them was to
    be taken out.
    """

    def __init__(self, path: Path, say: Callable[[Cause], None]) -> None:
        self._path, self._say = path, say
        self._stamp: Stamp | None = _stamp(path)
        self._users = users_in(path)
        self._why = ""

    @property
    def doubtful(self) -> bool:
        """Whether nobody knows who may do what."""
        return bool(self._why)

    def get(self, name: str) -> User | None:
        """The user with this name."""
        return self._users.get(name)

    def look(self) -> bool:
        """Read the file again if it is another one; returns whether the users may be others."""
        stamp = _stamp(self._path)
        if stamp == self._stamp:
            return False
        self._stamp = stamp
        why = "" if stamp == GONE else file_problem(self._path, secret=True)
        if not why:
            try:
                self._users = {} if stamp == GONE else users_in(self._path)
            except ConfigError as error:
                why = str(error)
            except OSError as error:
                self._stamp, why = None, f"{self._path}: {error.strerror or error}"  # it may be readable next time
        self._doubt(why)
        return not why

    def _doubt(self, why: str) -> None:
        if why and why != self._why:
            self._say(Cause.of("users_doubted", why=why))
        elif self._why and not why:
            self._say(Cause("users_trusted"))
        self._why = why
        if not why and not self._users:
            self._say(Cause.of("users_none", file=str(self._path)))


def _stamp(path: Path) -> Stamp:
    """What changes with the file."""
    try:
        found = os.stat(path)  # noqa: PTH116 - as short
    except FileNotFoundError:
        return GONE
    except OSError as error:
        return (-(error.errno or 1),)
    return found.st_ino, found.st_mtime_ns, found.st_ctime_ns, found.st_size, found.st_mode
