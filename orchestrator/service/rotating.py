"""A file of lines with bounded size: full parts are compressed, and the oldest part is dropped for lack of space.

Theory of operation. A part is compressed under another name, synced, renamed, and only then is the plain one removed: a
power cut at any moment leaves one whole copy at least. What it left half done is finished when the file is next used.
"""

import os
import zlib
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from orchestrator.service.disk import sync_directory
from orchestrator.service.parts import CHUNK, FRESH, GZIP, Parts, size_of


class RotatingFile:
    """`NAME.jsonl` is written; `NAME-000001.jsonl.gz` … are finished parts.

    `begin` makes the line with which this run of the service, and each part, begins. `durable`: lines are on disk once
    taken, so the reasons for a stop survive a power cut right after it.
    """

    def __init__(
        self, directory: Path, name: str, max_bytes: int, begin: Callable[[], bytes], *, durable: bool = False
    ) -> None:
        self._directory, self._begin, self._durable = directory, begin, durable
        self._parts = Parts(directory, name, f"{name}.jsonl", max_bytes)
        self._mended = False

    def take(self, lines: deque[bytes]) -> None:
        """Write these lines and remove them; OSError if the disk does not take them: the remaining ones are pending."""
        self._directory.mkdir(parents=True, exist_ok=True, mode=0o750)
        if not self._mended:
            self._parts.make_room(self._parts.size)  # it may have been larger, or an older version's
            self._finish_packing()
        while lines:
            taken = size_of(self._parts.open)
            begin = self._begin() if not taken or not self._mended else b""
            room = self._parts.size - taken - len(begin)
            batch: list[bytes] = []
            for line in lines:
                if len(line) > room and (batch or taken):
                    break
                batch.append(line)
                room -= len(line)
            if batch:
                self._append(begin + b"".join(batch))
                for _ in batch:
                    lines.popleft()
            else:
                self._rotate()

    def _append(self, data: bytes) -> None:
        path = self._parts.open
        append(path, data if self._mended else cut_off(path) + data, durable=self._durable)
        self._mended = True

    def _rotate(self) -> None:
        finished = self._parts.next(".jsonl")
        os.replace(self._parts.open, finished)  # noqa: PTH105 - as in disk.py
        self._parts.make_room(self._parts.size)
        with suppress(OSError):  # it stays plain: the next rotation tries again
            self._finish_packing()

    def _finish_packing(self) -> None:
        """Compress the finished parts that are still plain, and remove what an earlier attempt has left."""
        for path in self._parts.fresh():
            os.unlink(path)  # noqa: PTH108 - as in disk.py
        for path in self._parts.finished():
            if path.suffix == ".jsonl" and "-" in path.name:
                pack(path)


def pack(path: Path) -> None:
    """Replace the file by `NAME.gz`. A power cut at any moment leaves the one or the other, whole."""
    packed = path.with_name(f"{path.name}.gz")
    if not size_of(packed):
        fresh = path.with_name(f"{packed.name}{FRESH}")
        _compress(path, fresh)
        os.replace(fresh, packed)  # noqa: PTH105 - as in disk.py
    sync_directory(path.parent)
    os.unlink(path)  # noqa: PTH108 - as in disk.py


def _compress(path: Path, to: Path) -> None:
    """In chunks, during which other threads run; the result is on disk."""
    packer = zlib.compressobj(wbits=GZIP)
    with path.open("rb", buffering=0) as source, to.open("wb", buffering=0) as target:
        while chunk := source.read(CHUNK):
            _write_all(target.fileno(), packer.compress(chunk))
        _write_all(target.fileno(), packer.flush())
        os.fsync(target.fileno())


def _write_all(fd: int, data: bytes) -> None:
    while data:
        data = data[os.write(fd, data) :]


def append(path: Path, data: bytes, *, durable: bool) -> None:
    """All of it or nothing."""
    with path.open("ab", buffering=0) as file:
        before = file.tell()
        try:
            while data:
                data = data[file.write(data) :]
            if durable:
                os.fsync(file.fileno())
        except OSError:
            with suppress(OSError):
                file.truncate(before)
            raise


def cut_off(path: Path) -> bytes:
    """The bytes to write before the next line: a line end, if a power failure has cut off the last line."""
    size = size_of(path)
    if not size:
        return b""
    with path.open("rb") as file:
        file.seek(size - 1)
        return b"" if file.read(1) == b"\n" else b"\n"
