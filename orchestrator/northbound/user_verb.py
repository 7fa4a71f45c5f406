"""`orchestrator user add`: who may log in, with which password. Only the password's hash is kept."""

import errno
import os
import secrets
import sys
from collections.abc import Mapping
from getpass import getpass
from pathlib import Path

from orchestrator.config.names import name_problem
from orchestrator.config.northbound import Role, User
from orchestrator.config.users_file import quoted, users_in
from orchestrator.errors import CauseError, ConfigError, UsageError
from orchestrator.model import Cause
from orchestrator.northbound.password import LONGEST, SHORTEST, hashed
from orchestrator.show import own_language
from orchestrator.text.catalogue import say

HEAD = """\
# Who may log in to the station's page; written by `orchestrator user add`, which keeps no other comments.
# Remove somebody by removing the lines. The server reads a changed file at once.
users:
"""


def add_user(name: str, role: str, file: str) -> int:
    """Write the user with a new password into the file."""
    if problem := name_problem(name):
        raise UsageError(f"user: {problem}")
    path = Path(file)
    try:
        users = dict(users_in(path)) if path.exists() else {}
        users[name] = User(role=Role(role), password=hashed(_password(name)))
        _write(path, users)
    except OSError as error:
        raise CauseError(Cause.of("users_not_written", file=file, error=error.strerror or str(error))) from None
    except ConfigError as error:
        raise CauseError(Cause.of("users_not_written", file=file, error=error)) from None
    print(say(Cause.of("user_saved", name=name, role=role, file=file), own_language()))
    return 0


def _password(name: str) -> str:
    """Typed twice at a terminal, otherwise the first line of standard input."""
    if sys.stdin.isatty():
        language = own_language()
        password = getpass(f"{say(Cause.of('password_for', name=name), language)}: ")
        if getpass(f"{say(Cause('password_again'), language)}: ") != password:
            raise UsageError("user: the two passwords differ; nothing is changed")
    else:
        password = sys.stdin.readline().rstrip("\r\n")
    if not SHORTEST <= len(password) <= LONGEST:
        raise UsageError(f"user: a password has {SHORTEST} to {LONGEST} characters, this one has {len(password)}")
    return password


def _write(path: Path, users: Mapping[str, User]) -> None:
    """All of it or nothing, readable by its owner alone; who owned it before still does. It is read back first."""
    lines = [
        f"  {quoted(name)}: {{role: {user.role}, password: {quoted(user.password)}}}\n" for name, user in users.items()
    ]
    new = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    fd = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        with os.fdopen(fd, "w", encoding="utf-8") as file:
            file.writelines([HEAD, *lines])
            file.flush()
            if path.exists():
                before = path.stat()
                os.fchown(fd, before.st_uid, before.st_gid)
            os.fsync(fd)
        if users_in(new) != users:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        new.replace(path)
    except (OSError, ConfigError):
        new.unlink(missing_ok=True)
        raise
