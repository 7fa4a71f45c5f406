"""The files of a journal, line by line, in the order in which they were written. A tear costs what it hit alone."""

import json
import zlib
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from os import SEEK_END
from pathlib import Path
from typing import Any, BinaryIO

from orchestrator.config.plainfile import check_plain
from orchestrator.errors import ConfigError, Finding
from orchestrator.service.parts import CHUNK, FRESH, GZIP, order, stream_of

Fields = dict[str, Any]

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


def journals_of(files: Iterable[Path]) -> list[list[Path]]:
    """The files of each journal: of each directory, and each file that has both streams."""
    found: dict[Path, list[Path]] = {}
    for path in files:
        found.setdefault(path.parent if stream_of(path) in STREAMS else path, []).append(path)
    return list(found.values())


def from_part(files: Sequence[Path], wall: str) -> Sequence[Path]:
    """The files without those that end before this time."""
    begin = 0
    for number, path in enumerate(files):
        record = next((record for _, _, record in records_of([path], lambda _: True)), "")
        if isinstance(record, dict) and record["wall"] <= wall:
            begin = number
    return files[begin:]


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


def records_of(files: Iterable[Path], wanted: Callable[[bytes], bool]) -> Iterator[tuple[Path, int, Fields | str]]:
    """The record in each wanted line of the files, with file and number; or what is wrong with that line."""
    for path in files:
        for number, text in lines_of(path):
            if text is None:
                yield path, number, "something is torn here"
            elif wanted(text):
                try:
                    yield path, number, _record(text)
                except (LookupError, TypeError, ValueError, RecursionError, OverflowError) as error:
                    yield path, number, unreadable(error)


def unreadable(error: Exception) -> str:
    """What is wrong with a line that raised this."""
    wrong = f"{error!r:.200}"
    if isinstance(error, json.JSONDecodeError):
        wrong = "it is not JSON"
    elif type(error) is KeyError:
        wrong = f"it has no {error}"
    return f"this is no line of a journal: {wrong}"


def _record(text: bytes) -> Fields:
    """One line's object; ValueError for anything else."""
    line = json.loads(text)
    if not isinstance(line, dict) or not all(isinstance(line.get(key), str) for key in ("kind", "bay", "wall")):
        raise ValueError("it has t, wall, bay and kind")
    line["t"] = float(line["t"])
    return line


def may_continue(path: Path) -> bool:
    """Whether the oldest file that is left continues one that was dropped."""
    return order(path) < (1, 0) or (2, 1) < order(path) < (3, 0)


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
