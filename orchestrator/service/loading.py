"""Reads the persisted state of the last run, and derives each bay's past from it."""
# ruff: noqa: PTH105, PTH208 - as in `disk.py`

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.core.persisted import Persisted
from orchestrator.model import Cause
from orchestrator.service.disk import code_of, read_file
from orchestrator.service.past import Entry, Place, past_of, settled
from orchestrator.service.stateformat import Stamp, decode, decode_first

FILE, FIRST_FILE = "persisted.json", "kept.json"
#: Far more than any station needs.
MOST_BYTES = 16_000_000


@dataclass(frozen=True, slots=True)
class Loaded:
    """All entries, including those of the present bays."""

    entries: tuple[Entry, ...]
    run: int = 1  #: the number of this run
    aside: tuple[str, ...] = ()  #: files to be moved aside, for a person to inspect


def load(directory: Path, places: Sequence[Place], now: Stamp) -> Loaded:
    """Read it. If that fails, every bay is held, because latches may be lost."""
    path = directory / FILE
    try:
        found = _read(directory, now)
    except (OSError, ValueError) as error:
        reason = code_of(error) if isinstance(error, OSError) else str(error)
        return Loaded(
            held(places, Cause.of("state_unreadable", file=str(path), error=reason)), aside=(FILE, FIRST_FILE)
        )
    if found is None:
        if any(name.startswith("events") for name in names(directory)):  # the file is written before the first event
            return Loaded(held(places, Cause.of("state_lost", file=str(path))))
        return Loaded(tuple(Entry(place, Persisted(), 1) for place in places))
    run, entries = found
    pasts = {place: past_of(place, entries, str(path)) for place in places}
    return Loaded(tuple(settled(places, pasts, entries, run)), run)


def held(places: Sequence[Place], why: Cause) -> tuple[Entry, ...]:
    """An entry for every bay, held because its past is unknown."""
    return tuple(Entry(place, Persisted(hold=why), 1) for place in places)


def _read(directory: Path, now: Stamp) -> tuple[int, list[Entry]] | None:
    """The number of this run and all entries; None if there are none.

    A file of the first format beside ours is newer: an older version of the service has written it since.
    """
    ours = _bytes(directory / FILE)
    first = _bytes(directory / FIRST_FILE)
    if ours is None and first is None:
        return None
    run, entries = decode(ours, now) if ours is not None else (0, [])
    if first is not None:
        entries += decode_first(first, run + 1)
        run += 1
    return run + 1, entries


def _bytes(path: Path) -> bytes | None:
    try:
        return read_file(path, MOST_BYTES)
    except FileNotFoundError:
        return None


def names(directory: Path) -> list[str]:
    """The names in the directory."""
    try:
        return os.listdir(directory)
    except FileNotFoundError:
        return []


def move_aside(directory: Path, files: Sequence[str], word: str) -> None:
    """Rename these files, if they exist, without overwriting any."""
    there = names(directory)
    for name in files:
        if name in there:
            free = next(one for number in range(len(there) + 1) if (one := f"{name}.{word}-{number + 1}") not in there)
            os.replace(directory / name, directory / free)
