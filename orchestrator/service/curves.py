"""Writes the curves of charges, one gzip file each: used by the recorder's thread alone."""

import os
from pathlib import Path

from orchestrator.record.curve import FOLDER, HEAD, SUFFIX, member, outdated, whole_size
from orchestrator.record.stamp import NEVER_SET_S
from orchestrator.record.ulid import CHANCE, after
from orchestrator.service.disk import make_directory, read_file
from orchestrator.service.parts import size_of
from orchestrator.service.rotating import append

DAY_S = 86_400.0
#: No curve is larger.
MOST_BYTES = 16_000_000


class Curves:
    """The files of a station; every call may raise OSError."""

    def __init__(self, records: Path, days: float) -> None:
        self._folder, self._days = records / FOLDER, days
        self._mended: set[str] = set()  # written by this run

    def write(self, id_: str, text: str, wall_s: float) -> None:
        """Add these points to the curve of a charge."""
        path = self._folder / f"{id_}{SUFFIX}"
        if id_ not in self._mended:
            self._begin(path, wall_s)
        append(path, member(text if size_of(path) else HEAD + text), durable=False)
        self._mended.add(id_)

    def end(self, id_: str) -> None:
        """This charge has ended."""
        self._mended.discard(id_)

    def _begin(self, path: Path, wall_s: float) -> None:
        """Make room, and cut off what a power cut has torn: nothing can be read behind it."""
        make_directory(self._folder)
        if wall_s >= NEVER_SET_S:
            oldest = after("", max(wall_s - self._days * DAY_S, 0.0), bytes(CHANCE))
            for name in outdated(os.listdir(self._folder), oldest):  # noqa: PTH208 - as in disk.py
                os.unlink(self._folder / name)  # noqa: PTH108 - as in disk.py
        if size_of(path):
            data = read_file(path, MOST_BYTES)
            if whole_size(data) < len(data):
                with path.open("ab", buffering=0) as file:
                    file.truncate(whole_size(data))
