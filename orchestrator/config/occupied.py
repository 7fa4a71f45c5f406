"""Names in a station file that something else has already: only a look at the disk shows that, so only `check` does it.

`run` must not: a hung disk would delay the first stop, and it finds out by itself.
"""

import os
from collections.abc import Iterator
from pathlib import Path

from orchestrator.config.station import Station


def occupied(station: Station) -> Iterator[str]:
    """An error, with its line, for each name at which the service could create nothing."""
    control, directory = station.control, station.journal.directory
    sockets = {"control.socket": control.socket}
    if control.view_socket is not None:
        sockets["control.view_socket"] = control.view_socket
    for path, socket in sockets.items():
        if os.path.lexists(socket) and not socket.is_socket():
            what = "a directory" if socket.is_dir() else "a file"
            text = f"{socket} is {what}, where the service would create its socket: name a file that is not there yet"
            yield _error(station, path, text)
    for path, name in (*((path, socket.parent) for path, socket in sockets.items()), ("journal.directory", directory)):
        if (file := _file_in_the_way(name)) is not None:
            text = f"{file} is a file, where a directory is needed: name another directory, or move the file away"
            yield _error(station, path, text)


def _error(station: Station, path: str, text: str) -> str:
    return f"{station.source.at(path)}: error: {path}: {text}"


def _file_in_the_way(directory: Path) -> Path | None:
    """What is there instead of this directory, or of one above it."""
    nearest = next((one for one in (directory, *directory.parents) if os.path.lexists(one)), None)
    return nearest if nearest is not None and not nearest.is_dir() else None
