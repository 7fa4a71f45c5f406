"""Rules of a northbound file and of the file of its users: what is shown beyond this machine is shown to users only."""

import ipaddress
import os
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestrator.config.names import name_problem
from orchestrator.config.rules import Problems

#: A name in the DNS.
_HOST = re.compile(r"[A-Za-z0-9]([A-Za-z0-9_.-]{0,251}[A-Za-z0-9])?")
_LISTEN = re.compile(r"(?:\[([0-9a-fA-F:.]+)\]|([^\[\]:]+)):([0-9]{1,5})")
#: As `orchestrator user add` writes it: n, r, p, salt and hash.
PASSWORD = re.compile(r"scrypt:(\d{1,7}):(\d{1,2}):(\d):([0-9a-f]{32}):([0-9a-f]{64})")
LOCALHOST = "localhost"


@dataclass(frozen=True, slots=True)
class Listen:
    """An address and a port to listen at."""

    host: str
    port: int

    @classmethod
    def of(cls, text: str) -> "Listen":
        """From `127.0.0.1:8080` or `[::1]:8080`; ValueError says what is wrong."""
        match = _LISTEN.fullmatch(text)
        if not match or int(match[3]) > 65535:
            raise ValueError(f"{text[:80]!r}: write ADDRESS:PORT, for example 127.0.0.1:8080 or '[::1]:8080'")
        host = match[1] or match[2]
        if host != LOCALHOST and not _is_address(host):
            raise ValueError(f"{host[:80]!r} is no address: write that of one of this machine's networks, or localhost")
        return cls(host, int(match[3]))

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return self.host == LOCALHOST or ipaddress.ip_address(self.host).is_loopback


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True


def northbound_problems(values: Mapping[str, object]) -> Problems:
    """All findings between the keys, and in the files that they name."""
    yield from _listen(values)
    for i, host in enumerate(_tuple(values.get("page.hosts"))):
        if not _HOST.fullmatch(str(host)) and not _is_address(str(host)):
            yield f"page.hosts[{i}]", f"{str(host)[:80]!r} is no host name: write it without https:// and without port"
    for name, secret in (
        ("station", False), ("users", True), ("page.tls.cert_file", False), ("page.tls.key_file", True),
    ):  # fmt: skip
        if isinstance(path := values.get(name), Path) and (problem := file_problem(path, secret=secret)):
            yield name, problem


def _listen(values: Mapping[str, object]) -> Problems:
    if not isinstance(text := values.get("page.listen"), str):
        return
    try:
        listen = Listen.of(text)
    except ValueError as error:
        yield "page.listen", str(error)
        return
    missing = [name for name in ("page.tls", "users") if name in values and values[name] is None]
    if missing and not listen.is_loopback:
        yield (
            "page.listen",
            (
                f"{listen.host} can be reached from other machines: that needs {' and '.join(missing)} as well; "
                "without them listen at 127.0.0.1"
            ),
        )


def _tuple(value: object) -> tuple[object, ...]:
    return value if isinstance(value, tuple) else ()


def file_problem(path: Path, *, secret: bool) -> str:
    """Why the file cannot be used: not there, no file, or a secret that others may read; "" if nothing is wrong."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        return f"{path}: {getattr(error, 'strerror', None) or error}"
    if not stat.S_ISREG(mode):
        return f"{path} is no regular file"
    if secret and mode & 0o077:
        return f"{path} has mode {mode & 0o7777:04o}, others may read it: chmod 0600 {path}"
    if not os.access(path, os.R_OK):
        return f"{path}: permission denied for user {os.geteuid()}"
    return ""


def user_problems(values: Mapping[str, object]) -> Problems:
    """Names that nobody can type, and passwords that are no hashes."""
    for name in _names(values):
        if problem := name_problem(name):
            yield "users", problem
        password = values.get(f"users.{name}.password")
        if isinstance(password, str) and not PASSWORD.fullmatch(password):
            yield f"users.{name}.password", "this is no hash as `orchestrator user add` writes it: set it with that"


def _names(values: Mapping[str, object]) -> list[str]:
    users = values.get("users")
    return list(users) if isinstance(users, Mapping) else []
