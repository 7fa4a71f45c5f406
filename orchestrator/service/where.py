"""Finds the running service's control socket, without being told if possible."""

import os
from pathlib import Path

from orchestrator.config.ports import wiring
from orchestrator.errors import NoSocketError
from orchestrator.model import Cause

#: The default station file of `run`.
HERE = Path("station.yaml")
#: The socket of the service started by deploy/orchestrator.service.
INSTALLED = Path("/run/orchestrator/orchestrator.sock")


def find_socket(named: str | None, here: Path = HERE, installed: Path = INSTALLED) -> Path:
    """The named socket, else $ORCHESTRATOR_SOCKET, else that of the station file here, else the installed one.

    NoSocketError if there is none of these.
    """
    if name := named or os.environ.get("ORCHESTRATOR_SOCKET"):
        return Path(name)
    if written := _written(here):
        return Path(written)
    if may_be_there(installed):
        return installed
    raise NoSocketError(Cause.of("service_not_found", station=os.path.abspath(here), installed=str(installed)))  # noqa: PTH100 - for people


def origin(named: str | None, here: Path = HERE) -> Cause:
    """What named the socket that `find_socket` returns."""
    if named or os.environ.get("ORCHESTRATOR_SOCKET"):
        return Cause.of("socket_by_option", option="--socket" if named else "$ORCHESTRATOR_SOCKET")
    if _written(here):
        return Cause.of("socket_by_station", station=os.path.abspath(here))  # noqa: PTH100 - for people
    return Cause("socket_installed")


def _written(station: Path) -> str:
    try:
        return wiring(station).socket
    except OSError:
        return ""


def may_be_there(path: Path) -> bool:
    """Whether it exists; one in a directory that we may not look into counts: connecting reports who may."""
    try:
        return path.exists()
    except PermissionError:
        return True
