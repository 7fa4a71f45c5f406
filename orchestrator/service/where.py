"""Where the running service is found: its control socket, without being told if possible."""

import os
from pathlib import Path

from orchestrator.config.ports import wiring
from orchestrator.errors import UsageError

#: The station file that `run` takes where none is named.
HERE = Path("station.yaml")
#: Of the service that deploy/orchestrator.service starts.
INSTALLED = Path("/run/orchestrator/orchestrator.sock")


def find_socket(named: str | None, here: Path = HERE, installed: Path = INSTALLED) -> Path:
    """The socket that was named, else $ORCHESTRATOR_SOCKET, else that of the station file here, else the installed one.

    UsageError where there is none of these.
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
    """One in a folder that we may not look into is there: who asks it is told who may."""
    try:
        return path.exists()
    except PermissionError:
        return True
