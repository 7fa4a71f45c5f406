"""Finds the targets of an emergency stop that were not named: the station file, and ports that it does not name.

A station file may have been edited while a charger ran. So the service's persisted state counts as well: every port
whose charger may be running is stopped. Reading it is kept as robust as possible: anything not understood is skipped.
Standard library only.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path

from orchestrator.lastresort.port_owner import directory, orchestrators

#: The working directory first, then the installed service.
PLACES = ("station.yaml", "/etc/orchestrator/station.yaml")
#: The persisted state, in the journal's directory.
FILES = ("persisted.json", "kept.json")
#: More than any service writes.
MAX_BYTES = 16 * 1024 * 1024


def stations() -> Iterator[list[str]]:
    """Existing station files that may be meant, the likeliest first; several at once if they are equally likely."""
    for place in PLACES:
        yield _existing([place])
    yield _existing([os.path.join(directory(pid), name) for pid, words in orchestrators() if (name := _station(words))])  # noqa: PTH118


def _existing(paths: list[str]) -> list[str]:
    """The existing ones, each once. For paths that we may not look at, pathlib would raise."""
    return [path for path in dict.fromkeys(paths) if os.path.isfile(path)]  # noqa: PTH113


def ports_in_hand(journal: str) -> dict[str, str]:
    """Each port whose charger may be running according to the persisted state, with its bay's name."""
    ports: dict[str, str] = {}
    for file in FILES:
        for entry in _entries(Path(journal, file)):
            port, bay = entry.get("port"), entry.get("bay")
            if entry.get("running") and isinstance(port, str) and _is_path(port):
                ports.setdefault(port, bay if isinstance(bay, str) else "")
    return ports


def _is_path(text: str) -> bool:
    try:
        return b"/" in os.fsencode(text) and "\0" not in text
    except ValueError:  # a lone surrogate
        return False


def _entries(path: Path) -> list[dict[str, object]]:
    """The entries of a file; none for the first format, which had no ports."""
    try:
        with path.open("rb") as stream:
            document = json.loads(stream.read(MAX_BYTES))
    except (OSError, ValueError, RecursionError):
        return []
    entries = document.get("entries") if isinstance(document, dict) else None
    return [entry for entry in entries if isinstance(entry, dict)] if isinstance(entries, list) else []


def _station(words: list[str]) -> str:
    """The station file on a command line: of `orchestrator run [STATION]`, or of the controller that it starts."""
    if "run" in words:
        return (words[words.index("run") + 1 :] or [PLACES[0]])[0]
    return words[-1] if "orchestrator.service.controller" in words else ""
