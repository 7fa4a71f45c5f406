"""A file of lines with bounded size, compressed as it is written: each batch of lines is a gzip member of its own.

Theory of operation. Members one after another are one gzip file to every reader, so what has been written can be read
at any time, also after a power cut; that can tear the last member only, or those the disk had not taken yet. A file
torn like this is finished as it is, because nothing could be read beyond the tear by those who do not look for the next
member. Nothing is written twice, which spares an SD card.
"""

import os
import zlib
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path

from orchestrator.service.parts import CHUNK, GZIP, Parts, size_of
from orchestrator.service.rotating import append

#: The most of what is compressed at once: bounds memory, and what a torn member costs.
MEMBER = 1 << 18


class PackedFile:
    """`NAME.jsonl.gz` is written; `NAME-000001.jsonl.gz` … are finished parts.

    `begin` makes the line with which this run of the service, and each part, begins.
    """

    def __init__(self, directory: Path, name: str, max_bytes: int, begin: Callable[[], bytes]) -> None:
        self._directory, self._begin = directory, begin
        self._parts = Parts(directory, name, f"{name}.jsonl.gz", max_bytes)
        self._mended = self._begun = False

    def take(self, lines: deque[bytes]) -> None:
        """Write these lines and remove them; OSError if the disk does not take them: the remaining ones are pending."""
        self._directory.mkdir(parents=True, exist_ok=True, mode=0o750)
        if not self._mended:
            if not is_whole(self._parts.open):
                self._finish()
            self._parts.make_room(self._parts.size)  # it may have been larger, or an older version's
            self._mended = True
        while lines:
            batch, taken = _batch(lines), size_of(self._parts.open)
            member, begin = _member(batch), b"" if self._begun else _member([self._begin()])
            if taken and taken + len(begin) + len(member) > self._parts.size:
                self._finish()
                taken = 0
            append(self._parts.open, (begin if taken else _member([self._begin()])) + member, durable=False)
            self._begun = True
            for _ in batch:
                lines.popleft()

    def _finish(self) -> None:
        os.replace(self._parts.open, self._parts.next(".jsonl.gz"))  # noqa: PTH105 - as in disk.py
        self._parts.make_room(self._parts.size)


def _member(lines: Iterable[bytes]) -> bytes:
    packer = zlib.compressobj(wbits=GZIP)
    return packer.compress(b"".join(lines)) + packer.flush()


def _batch(lines: Iterable[bytes]) -> list[bytes]:
    """The first lines: one at least, and as many as make a member."""
    batch: list[bytes] = []
    size = 0
    for line in lines:
        size += len(line)
        if batch and size > MEMBER:
            break
        batch.append(line)
    return batch


def is_whole(path: Path) -> bool:
    """Whether the file ends with the end of a member, or does not exist."""
    if not size_of(path):
        return True
    unpacker, begun = zlib.decompressobj(wbits=GZIP), False
    try:
        with path.open("rb", buffering=0) as file:
            while data := file.read(CHUNK):
                while data:
                    unpacker.decompress(data)
                    data, begun = unpacker.unused_data, not unpacker.eof
                    if unpacker.eof:
                        unpacker = zlib.decompressobj(wbits=GZIP)
    except zlib.error:
        return False
    return not begun
