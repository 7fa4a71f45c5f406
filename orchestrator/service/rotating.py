"""A file of lines with bounded size: the space is divided into parts, and the oldest part is dropped."""

import os
from collections import deque
from contextlib import suppress
from pathlib import Path

#: The number of files into which the space is divided.
FILES = 8


class RotatingFile:
    """`NAME.jsonl` is written; `NAME.1.jsonl` … `NAME.7.jsonl` are older and are dropped for lack of space.

    `durable`: lines are on disk once taken, so the reasons for a stop survive a power cut right after it.
    """

    def __init__(self, directory: Path, name: str, max_bytes: int, *, durable: bool = False) -> None:
        self._directory, self._name, self._durable = directory, name, durable
        self._max_bytes = max(max_bytes // FILES, 4096)
        self._mended = False

    def take(self, lines: deque[bytes]) -> None:
        """Write these lines and remove them; OSError if the disk does not take them: the remaining ones are pending."""
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
    """The bytes to write before the next line: a line end, if a power failure has cut off the last line."""
    size = _size(path)
    if not size:
        return b""
    with path.open("rb") as file:
        file.seek(size - 1)
        return b"" if file.read(1) == b"\n" else b"\n"
