"""A file of lines that never takes more than its space: it is divided, and the oldest part goes."""

import os
from collections import deque
from contextlib import suppress
from pathlib import Path

#: Into how many files the space is divided.
FILES = 8


class RotatingFile:
    """`NAME.jsonl` is written; `NAME.1.jsonl` … `NAME.7.jsonl` are older and go when there is no space for them.

    What is `durable` is on the disk when it has been taken: the reasons for a stop outlive a power cut right after it.
    """

    def __init__(self, directory: Path, name: str, max_bytes: int, *, durable: bool = False) -> None:
        self._directory, self._name, self._durable = directory, name, durable
        self._max_bytes = max(max_bytes // FILES, 4096)
        self._mended = False

    def take(self, lines: deque[bytes]) -> None:
        """Write these lines and remove them; OSError where the disk does not take them: what is left is not written."""
        self._directory.mkdir(parents=True, exist_ok=True, mode=0o750)
        while lines:
            path = self._path(0)
            room = self._max_bytes - _size(path)
            batch: list[bytes] = []
            for line in lines:
                if len(line) > room and (batch or room < self._max_bytes):
                    break
                batch.append(line)
                room -= len(line)
            if batch:
                self._append(path, b"".join(batch))
                for _ in batch:
                    lines.popleft()
            else:
                self._rotate()

    def _append(self, path: Path, data: bytes) -> None:
        """All of it or nothing."""
        if not self._mended:
            self._mended = True
            data = _cut_off(path) + data
        with path.open("ab", buffering=0) as file:
            before = file.tell()
            try:
                while data:
                    data = data[file.write(data) :]
                if self._durable:
                    os.fsync(file.fileno())
            except OSError:
                with suppress(OSError):
                    file.truncate(before)
                raise

    def _path(self, age: int) -> Path:
        return self._directory / (f"{self._name}.{age}.jsonl" if age else f"{self._name}.jsonl")

    def _rotate(self) -> None:
        for age in range(FILES - 1, 0, -1):
            if self._path(age - 1).exists():
                self._path(age - 1).replace(self._path(age))


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _cut_off(path: Path) -> bytes:
    """What must be written before the next line: an end for the last one, if a power failure has cut that off."""
    size = _size(path)
    if not size:
        return b""
    with path.open("rb") as file:
        file.seek(size - 1)
        return b"" if file.read(1) == b"\n" else b"\n"
