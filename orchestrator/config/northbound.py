"""A northbound file: what the station shows to people and other systems outside, and to whom."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from orchestrator.keys import Source, key


@dataclass(frozen=True, slots=True, kw_only=True)
class Tls:
    """The certificate of the page's server."""

    cert_file: Path = key("the certificate with its chain, in PEM")
    key_file: Path = key("its private key, in PEM without a passphrase; mode 0600")


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """The page's own server."""

    listen: str = key("address and port; any address but a loopback one needs tls and users")
    hosts: tuple[str, ...] = key(
        "further names by which browsers may call this server; its address and localhost always are", default=()
    )
    tls: Tls | None = key("the certificate; null: plain HTTP, on loopback only", default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Northbound:
    """One northbound file."""

    station: Path = key("the station file of the service that is shown")
    page: Page = key("the page for browsers")
    users: Path | None = key(
        "who may log in, made by `orchestrator user add`; null: everybody on this machine is an operator", default=None
    )
    source: Source = field(default=Source("<northbound>"), compare=False)


class Role(StrEnum):
    """What a user may do."""

    VIEWER = "viewer"  #: look
    OPERATOR = "operator"  #: also start, pause, stop and reset


@dataclass(frozen=True, slots=True, kw_only=True)
class User:
    """One who may log in."""

    role: Role = key("viewer: may look; operator: may also start, pause, stop and reset")
    password: str = key("the password's scrypt hash, as `orchestrator user add` writes it")


@dataclass(frozen=True, slots=True, kw_only=True)
class UsersFile:
    """The file of those who may log in."""

    users: Mapping[str, User] = key("the users by name")
