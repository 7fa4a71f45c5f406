"""One month's file: its lines from a place on, and what shows that it is still the file that was read."""

import io
import zlib
from collections.abc import Iterator
from gzip import BadGzipFile, GzipFile
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, cast

from orchestrator.record.months import PACKED, files

#: So many bytes before the place where reading stopped show that what came before is the same.
TAIL = 4096
#: The end of a gzip file: CRC-32 and length of what was compressed.
TRAILER = 8
BUFFER = 1 << 20
#: A line that is longer is no record: damage, that must not fill the memory.
LONGEST = 8 << 20
#: What reading a damaged gzip file raises.
DAMAGED = (BadGzipFile, EOFError, zlib.error)


class Known(NamedTuple):
    """How far a file was read."""

    read: int  #: bytes, of a packed file modulo 2³²
    crc: int  #: CRC-32 of these
    tail: int  #: CRC-32 of the last of these; 0: it is packed


def present(folder: Path) -> list[str]:
    """The files of records there, by their month."""
    return files(path.name for path in folder.iterdir() if path.is_file())


def is_packed(name: str) -> bool:
    """Whether it is the file of a month that is over."""
    return name.endswith(PACKED)


def trailer(path: Path) -> Known:
    """How far a packed file goes, by its own word."""
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - TRAILER, 0))
        end = file.read(TRAILER).ljust(TRAILER, b"\0")
    return Known(int.from_bytes(end[4:], "little"), int.from_bytes(end[:4], "little"), 0)


def is_continued(path: Path, known: Known) -> bool:
    """Whether it is what was read, with or without something after it."""
    if is_packed(path.name):
        return trailer(path) == known
    return path.stat().st_size >= known.read and _tail(path, known.read) == known.tail


def is_more(path: Path, known: Known | None) -> bool:
    """Whether there is something to read."""
    return known is None or (not is_packed(path.name) and path.stat().st_size > known.read)


def is_same(known: Known, packed: Path) -> bool:
    """Whether a packed file is the plain one that was read."""
    end = trailer(packed)
    return (known.read % (1 << 32), known.crc) == (end.read, end.crc)


def _tail(path: Path, read: int) -> int:
    with path.open("rb") as file:
        file.seek(max(read - TAIL, 0))
        return zlib.crc32(file.read(min(TAIL, read)))


class _Unpacked(GzipFile):
    """Gives what it has at once: what comes before damage is not lost with it."""

    def readinto(self, into: Any) -> int:  # noqa: ANN401 - any buffer
        data = self.read1(len(into))
        into[: len(data)] = data
        return len(data)


def opened(path: Path) -> BinaryIO:
    """The file as it was written, packed or not."""
    file = path.open("rb", BUFFER)
    return cast("BinaryIO", io.BufferedReader(_Unpacked(fileobj=file), BUFFER)) if is_packed(path.name) else file


def lines(file: BinaryIO) -> Iterator[bytes]:
    """Its lines; one that is too long in pieces."""
    return iter(lambda: file.readline(LONGEST), b"")


class Reader:
    """Reads what is new of a file: iterate once, then `known` is how far that was."""

    def __init__(self, path: Path, known: Known | None) -> None:
        self._path = path
        self.is_damaged = False  #: what comes after the damage is lost
        self.at, self._crc = (known.read, known.crc) if known is not None else (0, 0)  #: where it begins

    def __iter__(self) -> Iterator[bytes]:
        """Its whole lines; of a damaged file those before the damage."""
        if is_packed(self._path.name):
            self.is_damaged = self._path.stat().st_size == 0
            try:
                with opened(self._path) as file:
                    yield from lines(file)
            except DAMAGED:
                self.is_damaged = True
            return
        with opened(self._path) as file:
            file.seek(self.at)
            for line in lines(file):
                if not line.endswith(b"\n") and len(line) < LONGEST:
                    return  # it is being written, or torn
                self._crc, self.at = zlib.crc32(line, self._crc), self.at + len(line)
                yield line

    @property
    def known(self) -> Known:
        """How far it was read."""
        if is_packed(self._path.name):
            return trailer(self._path)
        return Known(self.at, self._crc, _tail(self._path, self.at))
