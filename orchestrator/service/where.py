"""Finds the running service's control socket, without being told if possible."""

import os
from pathlib import Path

from orchestrator.config.ports import wiring
from orchestrator.errors import UsageError

#: The default station file of `run`.
HERE = Path("station.yaml")
#: The socket of the service started by deploy/orchestrator.service.
INSTALLED = Path("/run/orchestrator/orchestrator.sock")


def find_socket(named: str | None, here: Path = HERE, installed: Path = INSTALLED) -> Path:
    """The named socket, else $ORCHESTRATOR_SOCKET, else that of the station file here, else the installed one.

    UsageError if there is none of these.
    """
    if name := named or os.environ.get("ORCHESTRATOR_SOCKET"):
        return Path(name)
    if written := _written(here):
        return Path(written)
    if _may_be_there(installed):
        return installed
    raise UsageError(
        f"no service found: $ORCHESTRATOR_SOCKET is not set, no {here} in this folder names a control socket, and "
        f"there is no {installed}; name the socket with --socket PATH"
    )


def _written(station: Path) -> str:
    try:
        return wiring(station).socket
    except OSError:
        return ""


def _may_be_there(path: Path) -> bool:
    """Whether it exists; one in a directory that we may not look into counts: connecting reports who may."""
    try:
        return path.exists()
    except PermissionError:
        return True
