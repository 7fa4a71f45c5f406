"""The files of a journal, line by line, in the order in which they were written. A tear costs what it hit alone."""

import zlib
from collections.abc import Collection, Generator, Iterable, Iterator
from os import SEEK_END
from pathlib import Path
from typing import BinaryIO

from orchestrator.config.plainfile import check_plain
from orchestrator.errors import ConfigError, Finding
from orchestrator.service.parts import CHUNK, FRESH, GZIP, order

STREAMS = ("events", "snapshots")
#: How a gzip member begins.
MAGIC = b"\x1f\x8b\x08"
#: The most that is unpacked at once.
MOST = 1 << 20
#: A line longer than this is none of ours.
MAX_LINE = 1 << 24


def files_of(paths: Iterable[Path]) -> list[Path]:
    """The files, and the stream files of directories; the oldest first."""
    found: list[Path] = []
    for path in paths:
        inside = [one for name in STREAMS for one in path.glob(f"{name}*.jsonl*")] if path.is_dir() else [path]
        if not inside:
            raise wrong(path, 1, "there is no journal here: events.jsonl and snapshots.jsonl.gz")
        found += inside
    return sorted((path for path in found if path.suffix != FRESH and not _also_packed(path, found)), key=order)


def _also_packed(path: Path, found: Collection[Path]) -> bool:
    """Whether it is a finished part whose compressed copy is there, too: a power cut came before it was removed."""
    return "-" in path.name and path.with_name(f"{path.name}.gz") in found


def lines_of(path: Path) -> Iterator[tuple[int, bytes | None]]:
    """Each line that is not empty, with its number; None where something cannot be read."""
    try:
        check_plain(path, "a journal: JSON Lines, or a directory of them")
        with path.open("rb") as file:
            yield from _lines(_unpacked(file) if path.suffix == ".gz" else iter(lambda: file.read(CHUNK), b""))
    except OSError as error:
        raise wrong(path, 1, f"cannot be read: {error.strerror or error}") from None


def _lines(chunks: Iterable[bytes | None]) -> Iterator[tuple[int, bytes | None]]:
    number, rest = 0, b""
    for chunk in chunks:
        torn = chunk is None or len(rest) > MAX_LINE
        *whole, rest = [b""] if torn else (rest + (chunk or b"")).split(b"\n")
        for line in whole:
            number += 1
            if line.strip():
                yield number, line
        if torn:
            number += 1
            yield number, None
    if rest.strip():
        yield number + 1, rest


def _unpacked(file: BinaryIO) -> Iterator[bytes | None]:
    """The content of the gzip members, and None for each tear: what can be read before and after it is there."""
    at, torn = 0, False
    while (begin := _find_member(file, at)) is not None:
        if begin > at and not torn:
            yield None
        at, torn = yield from _member(file, begin)
        if torn:
            yield None
    if not torn and file.seek(0, SEEK_END) > at:
        yield None


def _member(file: BinaryIO, begin: int) -> Generator[bytes, None, tuple[int, bool]]:
    """Its content; returns where to go on, and whether it is torn."""
    unpacker, end = zlib.decompressobj(wbits=GZIP), file.seek(begin)
    try:
        while not unpacker.eof and (data := file.read(CHUNK)):
            end += len(data)
            while data:
                yield unpacker.decompress(data, MOST)
                data = unpacker.unconsumed_tail
    except zlib.error:
        pass
    return (end - len(unpacker.unused_data), False) if unpacker.eof else (begin + 1, True)


def _find_member(file: BinaryIO, at: int) -> int | None:
    """Where the next member begins, at `at` or later."""
    file.seek(at)
    before = b""
    while data := file.read(CHUNK if before else len(MAGIC)):
        found = (before + data).find(MAGIC)
        if found >= 0:
            return at - len(before) + found
        at += len(data)
        before = (before + data)[1 - len(MAGIC) :]
    return None


def wrong(path: Path, number: int, text: str) -> ConfigError:
    """The error for a file that cannot be read at all."""
    return ConfigError((Finding(str(path), number, 1, text),))
