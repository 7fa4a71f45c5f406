"""The finished parts of one stream: their names, their order, and the space that they may take.

`NAME-000007.jsonl.gz` is a finished part; numbers only grow, so a reader never sees one file become another. A journal
of an older version has parts `NAME.7.jsonl` … `NAME.1.jsonl`, the oldest first, which are older than all of these.
"""

import os
import re
import zlib
from collections.abc import Iterator
from pathlib import Path

#: The space is divided into at least this many parts, so that little is lost with the oldest …
PARTS = 16
#: … none of which is larger than this: a reader that looks for a time skips whole parts.
MAX_PART = 4_000_000
MIN_PART = 4096
#: What a file being compressed is named until it is whole.
FRESH = ".new"
#: zlib's format with a gzip header, and how much is compressed or read at once.
GZIP, CHUNK = 16 + zlib.MAX_WBITS, 1 << 16
_NAME = re.compile(r"(?P<name>[a-z]+)(\.(?P<age>\d+)|-(?P<number>\d+))?\.jsonl(?P<gz>\.gz)?")


def order(path: Path) -> tuple[int, int]:
    """Sorts the files of one stream, the oldest first."""
    found = _NAME.fullmatch(path.name)
    if found is None:
        return 3, 0
    if found["age"]:
        return 0, -int(found["age"])
    if found["number"]:
        return 2, int(found["number"])
    return (1 if path.name == "snapshots.jsonl" else 3), 0  # the former: the newest of an older version


def stream_of(path: Path) -> str:
    """The stream's name: "events" for `events-000007.jsonl.gz`."""
    found = _NAME.fullmatch(path.name)
    return found["name"] if found else path.name.partition(".")[0]


class Parts:
    """The finished parts of one stream in a directory; `open_name` is the file being written, which is not one."""

    def __init__(self, directory: Path, name: str, open_name: str, max_bytes: int) -> None:
        self._directory, self._name, self._max_bytes = directory, name, max_bytes
        self.open = directory / open_name
        self.size = max(min(max_bytes // PARTS, MAX_PART), MIN_PART)  #: at which the open part is finished

    def finished(self) -> list[Path]:
        """The finished parts, the oldest first."""
        return sorted(self._files(), key=order)

    def next(self, suffix: str) -> Path:
        """The name for the part that is finished now."""
        last = max((order(path)[1] for path in self._files() if order(path)[0] == 2), default=0)
        return self._directory / f"{self._name}-{last + 1:06}{suffix}"

    def make_room(self, size: int) -> None:
        """Drop the oldest parts until there is room for this many bytes, the open part's among them."""
        parts = [(path, size_of(path)) for path in self.finished()]
        total = sum(taken for _, taken in parts)
        for path, taken in parts:
            if total + size <= self._max_bytes:
                return
            os.unlink(path)  # noqa: PTH108 - as in disk.py
            total -= taken

    def fresh(self) -> list[Path]:
        """Files whose compression was cut short."""
        return [path for path in self._listed() if path.name.endswith(FRESH)]

    def _files(self) -> Iterator[Path]:
        return (path for path in self._listed() if path != self.open and _NAME.fullmatch(path.name))

    def _listed(self) -> Iterator[Path]:
        beginnings = (f"{self._name}.", f"{self._name}-")
        names = os.listdir(self._directory)  # noqa: PTH208 - as in disk.py
        return (self._directory / name for name in names if name.startswith(beginnings))


def size_of(path: Path) -> int:
    """Its length; 0 if it does not exist."""
    try:
        return os.stat(path).st_size  # noqa: PTH116 - as in disk.py
    except FileNotFoundError:
        return 0
