"""Fuzz targets and their inputs: good ones, mutated piece by piece.

An input is bytes for every target, so a crash is a file. The same inputs come from hypothesis in `make test` and from
atheris, guided by coverage, in `make fuzz`.
"""

import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random

#: The share of mutations that replace a piece by another of its kind, so the result stays well-formed.
ALIKE = 0.75
TRIES = 4  #: attempts to find a piece with others of its kind: most characters have none

Cut = Callable[[bytes], list[bytes]]

#: A file system in memory, if there is one.
MEMORY = "/dev/shm" if Path("/dev/shm").is_dir() else None
_SCRATCH: list[tempfile.TemporaryDirectory[str]] = []


def scratch() -> Path:
    """A directory removed at the end of the process."""
    _SCRATCH.append(tempfile.TemporaryDirectory(prefix="fuzz-"))
    return Path(_SCRATCH[-1].name)


@dataclass(frozen=True, eq=False)
class Target:
    """One entry point for foreign bytes."""

    one: Callable[[bytes], None]  #: handles one input; raises on whatever must not happen
    cut: Cut  #: splits an input into meaningful pieces
    kind: Callable[[bytes], object]  #: of a piece; another of the same kind may replace it
    seeds: Sequence[bytes]  #: good inputs to start from
    words: Sequence[bytes]  #: pieces that lead somewhere
    modules: Sequence[str]  #: whose coverage is reported
    max_bytes: int  #: of an input
    limit_s: float  #: maximum CPU time per input on a slow machine
    blind: float = 0.3  #: share of inputs the fuzzer mutates without knowing the pieces


def records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """A story, where one message is not enough: a kind (0 … 7) and up to 31 bytes per event."""
    at = 0
    while at < len(data):
        end = at + 1 + (data[at] & 0x1F)
        yield data[at] >> 5, data[at + 1 : end]
        at = end


def record(kind: int, content: bytes = b"") -> bytes:
    """The bytes of one event."""
    assert len(content) < 32
    return bytes((kind << 5 | len(content),)) + content


def cut_records(data: bytes) -> list[bytes]:
    """Pieces are events."""
    return [record(kind, content) for kind, content in records(data)]


def kind_of_record(piece: bytes) -> object:
    """Events of one kind are alike."""
    return piece[:1] and piece[0] >> 5


def kind_of_word(token: bytes) -> object:
    """All numbers are one kind, as are file names, and other words and strings; any other character is its own kind."""
    if not re.match(rb"[\w\"'./+-]", token):
        return token[:1]
    if b"/" in token or b".yaml" in token:
        return b"/"
    return b"0" if re.match(rb"[-+.]?\d", token) else b"w"


def changed(target: Target, data: bytes, random: Random) -> bytes:
    """The input with some pieces mutated."""
    pieces = target.cut(data) or [b""]
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        _change(target, pieces, random)
    return b"".join(pieces)[: target.max_bytes]


def _change(target: Target, pieces: list[bytes], random: Random) -> None:
    if random.random() < ALIKE:
        _exchange(target, pieces, random)
        return
    at = random.randrange(len(pieces))
    end = min(len(pieces), at + random.choice((1, 1, 1, 2, 5)))
    other = _cut(target.cut, random.choice(target.seeds))
    begin = random.randrange(len(other) + 1)
    pieces[at:end] = random.choice((
        [],
        [random.choice(target.words)],
        [random.choice(target.words), *pieces[at:end]],
        [_damaged(piece, random) for piece in pieces[at:end]],
        pieces[at:end] * random.choice((2, 2, 3, 50)),
        other[begin : begin + random.choice((1, 1, 3, 8))],
        [*pieces[at:end], *random.sample(pieces, min(3, len(pieces)))],
    )) or [b""]  # fmt: skip


def _exchange(target: Target, pieces: list[bytes], random: Random) -> None:
    for at in random.choices(range(len(pieces)), k=TRIES):
        alike = _by_kind(target).get(target.kind(pieces[at]), ())
        if len(alike) > 1:
            pieces[at] = random.choice(alike)
            return


@cache
def _cut(cut: Cut, seed: bytes) -> list[bytes]:
    return cut(seed)


@cache
def _by_kind(target: Target) -> dict[object, list[bytes]]:
    """Every distinct piece of its seeds and words, by kind."""
    found: dict[object, list[bytes]] = {}
    for piece in dict.fromkeys(piece for source in (*target.seeds, *target.words) for piece in target.cut(source)):
        found.setdefault(target.kind(piece), []).append(piece)
    return found


def _damaged(piece: bytes, random: Random) -> bytes:
    """One byte changed, added or removed."""
    at = random.randrange(len(piece) + 1)
    byte = bytes((random.choice((0, 0xFF, 0x7F, 0x80, random.randrange(256))),))
    return piece[:at] + random.choice((byte, b"", byte + piece[at : at + 1])) + piece[at + 1 :]
