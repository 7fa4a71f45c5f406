"""Where the journal is that a verb reads, and the files of its events."""

import os
import pwd
from pathlib import Path
from typing import cast

from orchestrator.config.ports import wiring
from orchestrator.errors import NoServiceError, OrchestratorError, UsageError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.service.journal_files import files_of
from orchestrator.service.parts import stream_of
from orchestrator.service.where import HERE, find_socket, may_be_there
from orchestrator.show import own_language
from orchestrator.text.catalogue import say

#: The journal of the installed service, as docs/install.md has it.
INSTALLED = Path("/var/lib/orchestrator/journal")
#: How long to wait for a service that knows where its journal is.
ANSWER_S = 2.0


def journal_place(named: str | None, socket: str | None, here: Path = HERE, installed: Path = INSTALLED) -> Path:
    """The named directory, else that of the service asked for, of the station file here, of the installed service.

    UsageError if there is none of these.
    """
    if named:
        return Path(named)
    if socket or os.environ.get("ORCHESTRATOR_SOCKET"):
        return _told(find_socket(socket))
    if written := _written(here):
        return Path(written)
    try:
        return _told(find_socket(None))
    except OrchestratorError:
        if may_be_there(installed):
            return installed
    cause = Cause.of("journal_unfound", file=str(here), directory=str(installed))
    raise UsageError(say(cause, own_language()))


def _told(socket: Path) -> Path:
    """As the service says."""
    try:
        document = ask(socket, {"verb": "status"}, ANSWER_S)
    except NoServiceError as error:
        raise NoServiceError(f"{error}; without it, name the journal's directory with --journal") from None
    directory = cast("dict[str, str]", document.get("journal", {})).get("directory")
    if not directory:
        raise UsageError("this service is of an older version: name its journal's directory with --journal")
    return Path(directory)


def _written(station: Path) -> str:
    try:
        return wiring(station).journal
    except OSError:
        return ""


def event_files(directory: Path) -> list[Path]:
    """The files of its events, the oldest first. UsageError if there are none, NoServiceError if we may not."""
    try:
        os.listdir(directory)  # noqa: PTH208 - a directory that is closed to us looks empty to `glob`
        files = [path for path in files_of([directory]) if stream_of(path) == "events"]
        for path in files[-1:]:
            path.open("rb").close()
    except PermissionError as error:
        owner = _owner(Path(error.filename or directory))
        cause = Cause.of("journal_forbidden", directory=str(directory), owner=owner)
        raise NoServiceError(say(cause, own_language())) from None
    except (OSError, OrchestratorError):
        files = []
    if not files:
        raise UsageError(say(Cause.of("journal_absent", directory=str(directory)), own_language()))
    return files


def _owner(path: Path) -> str:
    """Who may read it, as far as we can tell."""
    for place in (path, path.parent):
        try:
            return pwd.getpwuid(place.stat().st_uid).pw_name
        except (OSError, KeyError):
            continue
    return "its owner"
