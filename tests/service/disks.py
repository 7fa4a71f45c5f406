"""Worn disks: a system call that hangs until released, or fails."""

import errno
import os
from threading import Event

import pytest

from orchestrator.service import disk, loading


class WornDisk:
    """`os` for the store: real, except for the calls in `hangs` and `fails`."""

    def __init__(self) -> None:
        self.hangs: set[str] = set()
        self.fails: dict[str, int] = {}  #: call → errno
        self.called: list[str] = []
        self.go = Event()

    def __getattr__(self, name: str) -> object:
        real = getattr(os, name)
        if not callable(real):
            return real

        def call(*args: object, **named: object) -> object:
            self.called.append(name)
            if name in self.hangs:
                self.go.wait()
            if name in self.fails:
                raise OSError(self.fails[name], os.strerror(self.fails[name]))
            return real(*args, **named)

        return call

    def heal(self) -> None:
        """Release the hanging calls; later calls work."""
        self.hangs.clear()
        self.fails.clear()
        self.go.set()

    @classmethod
    def under(cls, monkeypatch: pytest.MonkeyPatch) -> "WornDisk":
        """Put it under every later call of the store."""
        worn = cls()
        monkeypatch.setattr(disk, "os", worn)
        monkeypatch.setattr(loading, "os", worn)
        return worn


FULL = errno.ENOSPC
