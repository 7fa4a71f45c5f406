"""What an emergency stop is about when nobody says it: the station file, and ports that the file does not name.

A station file may have been edited while a charger ran. So what the service has written down counts as well: each port
whose charger may be running is stopped, too. That is read with the least that can go wrong: what is not understood is
passed over. Standard library only.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path

from orchestrator.lastresort.port_owner import directory, orchestrators

#: Here, else where the service is installed.
PLACES = ("station.yaml", "/etc/orchestrator/station.yaml")
#: What survives a restart, as the service writes it into its journal's directory.
FILES = ("persisted.json", "kept.json")
#: More than any service writes.
MAX_BYTES = 16 * 1024 * 1024


def stations() -> Iterator[list[str]]:
    """Station files that may be meant, the likeliest first, together where several are; only such as are there."""
    for place in PLACES:
        yield _existing([place])
    yield _existing([os.path.join(directory(pid), name) for pid, words in orchestrators() if (name := _station(words))])  # noqa: PTH118


def _existing(paths: list[str]) -> list[str]:
    """Each once. Of what we may not look at, pathlib would make an error."""
    return [path for path in dict.fromkeys(paths) if os.path.isfile(path)]  # noqa: PTH113


def ports_in_hand(journal: str) -> dict[str, str]:
    """Each port whose charger may be running, by what the service has written down, with its bay's name."""
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
    except ValueError:  # half a character
        return False


def _entries(path: Path) -> list[dict[str, object]]:
    """None of the first format: that knew no ports."""
    try:
        with path.open("rb") as stream:
            document = json.loads(stream.read(MAX_BYTES))
    except (OSError, ValueError, RecursionError):
        return []
    entries = document.get("entries") if isinstance(document, dict) else None
    return [entry for entry in entries if isinstance(entry, dict)] if isinstance(entries, list) else []


def _station(words: list[str]) -> str:
    """The station file on a command line: of `orchestrator run [STATION]`, or of the controller that this starts."""
    if "run" in words:
        return (words[words.index("run") + 1 :] or [PLACES[0]])[0]
    return words[-1] if "orchestrator.service.controller" in words else ""
