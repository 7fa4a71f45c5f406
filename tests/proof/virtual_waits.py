"""Waiting on the virtual kernel, for input or a time-out."""

import select
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from math import inf
from typing import Any

from tests.proof.virtual_descriptors import Descriptors
from tests.proof.virtual_disk import Inode
from tests.proof.virtual_files import Death, Socket, Stream
from tests.proof.virtual_tty import Tty


class Waits(Descriptors):
    """`select`, and the sleep of threads."""

    def select(
        self, readers: Iterable[int], writers: Iterable[int], _: object, timeout: float | None = None
    ) -> tuple[list[int], list[int], list[int]]:
        self.calls("select")
        readers, writers = list(readers), list(writers)
        end_s = inf if timeout is None else self.time.now_s + timeout
        while True:
            can_read, can_write = list(filter(self.readable, readers)), list(filter(self.writable, writers))
            if can_read or can_write or self.time.now_s >= end_s:
                return can_read, can_write, []
            self.sleep([*readers, *writers], end_s)

    def sleep(self, fds: Iterable[int], end_s: float) -> None:
        """Wait until an event on one of these, or until then."""
        with self._listening([what for fd in fds if (what := self._what(fd)) is not None]):
            self.time.wait(end_s)

    @contextmanager
    def _listening(self, nodes: list[Any]) -> Iterator[None]:
        me = self.time.me()
        for node in nodes:
            node.news.waiting.append(me)
        try:
            yield
        finally:
            for node in nodes:
                node.news.waiting.remove(me)

    def _what(self, fd: Any) -> Any:
        number = self.number(fd)
        if number in self.output:
            return self.output[number]
        entry = self._open.get(number)
        return None if entry is None or isinstance(entry[0].what, Inode) else entry[0].what

    def readable(self, fd: Any) -> bool:
        what = self._what(fd)
        if isinstance(what, Tty):
            return what.readable or not what.present
        if isinstance(what, Socket):
            return bool(what.heard) or what.peer is None or what.peer.closed
        return isinstance(what, Death) and what.process.dead

    def writable(self, fd: Any) -> bool:
        what = self._what(fd)
        if isinstance(what, Tty):
            return not what.stalled or not what.present
        return isinstance(what, Socket) or (isinstance(what, Stream) and not what.stopped)


class Poll:
    """`select.poll()`."""

    def __init__(self, kernel: Waits) -> None:
        self._kernel = kernel
        self._masks: dict[int, int] = {}

    def register(self, fd: Any, mask: int = select.POLLIN | select.POLLOUT) -> None:
        self._masks[self._kernel.number(fd)] = mask

    def unregister(self, fd: Any) -> None:
        del self._masks[self._kernel.number(fd)]

    modify = register

    def poll(self, timeout_ms: float | None = None) -> list[tuple[int, int]]:
        kernel = self._kernel
        told = kernel.calls("poll")
        if told is not None:
            return [(fd, int(told)) for fd in self._masks]
        end_s = inf if timeout_ms is None or timeout_ms < 0 else kernel.time.now_s + timeout_ms / 1000
        while not (ready := list(self._ready())) and kernel.time.now_s < end_s:
            kernel.sleep(self._masks, end_s)
        return ready

    def _ready(self) -> Iterator[tuple[int, int]]:
        kernel = self._kernel
        for fd, mask in self._masks.items():
            events = (mask & select.POLLIN) * kernel.readable(fd) | (mask & select.POLLOUT) * kernel.writable(fd)
            if kernel.ours(fd) and fd not in kernel._open:
                events = select.POLLNVAL
            if events:
                yield fd, events
