"""The product's modules on the virtual kernel: everything they imported from the real one is replaced by identity.

No module or function of the product is named here: a module that starts to use `os.fsync` runs on the virtual kernel
from then on. Later imports inside functions find modules already replaced.
"""

import fcntl
import importlib
import io
import os
import pathlib
import pkgutil
import queue
import select
import signal
import socket
import sys
import termios
import threading
import time as real_time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache, partial
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import patch

import serial.serialposix
import serial.serialutil

import orchestrator
from tests.proof.virtual_kernel import Kernel
from tests.proof.virtual_process import Processes
from tests.proof.virtual_threads import Condition, Event, Lock, SimpleQueue, Thread

#: The parts of the package that run in the service.
PARTS = ("orchestrator.service", "orchestrator.lastresort", "orchestrator.link", "orchestrator.devices")
#: The wall clock at the start of the world (1000 s).
WALL_S = 1_700_000_000.0


@cache
def modules() -> tuple[ModuleType, ...]:
    """All of them, imported."""
    found = [serial.serialposix]
    names = (info.name for info in pkgutil.walk_packages(orchestrator.__path__, "orchestrator."))
    found += [importlib.import_module(name) for name in names if name.startswith(PARTS)]
    return tuple(found)


class Raw(io.RawIOBase):
    """A file as returned by `open`."""

    def __init__(self, kernel: Kernel, fd: int) -> None:
        self._kernel, self._fd = kernel, fd

    def fileno(self) -> int:
        return self._fd

    def readable(self) -> bool:
        return True

    writable = seekable = readable

    def readinto(self, buffer: Any) -> int:
        data = self._kernel.read(self._fd, len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def write(self, data: Any) -> int:
        return self._kernel.write(self._fd, bytes(data))

    def seek(self, at: int, whence: int = 0) -> int:
        return self._kernel.lseek(self._fd, at, whence)

    def truncate(self, size: int | None = None) -> int:
        length = self.tell() if size is None else size
        self._kernel.ftruncate(self._fd, length)
        return length

    def close(self) -> None:
        if not self.closed:
            super().close()
            if self._fd in self._kernel._open:
                self._kernel.close(self._fd)


FLAGS = {
    "r": os.O_RDONLY,
    "w": os.O_WRONLY | os.O_CREAT | os.O_TRUNC,
    "a": os.O_WRONLY | os.O_CREAT | os.O_APPEND,
    "x": os.O_WRONLY | os.O_CREAT | os.O_EXCL,
}


def open_file(kernel: Kernel, path: Any, mode: str = "r", buffering: int = -1, encoding: str | None = None) -> Any:
    """`open`."""
    raw = Raw(kernel, kernel.open(path, FLAGS[mode.replace("b", "").replace("t", "")[0]]))
    if mode.startswith("a"):
        raw.seek(0, os.SEEK_END)
    if buffering == 0:
        return raw
    buffered = io.BufferedReader(raw) if mode.startswith("r") else io.BufferedWriter(raw)
    return buffered if "b" in mode else io.TextIOWrapper(buffered, encoding=encoding or "utf-8")


def path_class(kernel: Kernel) -> type[pathlib.PosixPath]:
    """`pathlib.Path` on the virtual disk, for paths below its root."""

    class DiskPath(pathlib.PosixPath):
        def open(self, mode: str = "r", buffering: int = -1, encoding: str | None = None, *_: Any, **__: Any) -> Any:
            return open_file(kernel, str(self), mode, buffering, encoding)

        def stat(self, *, follow_symlinks: bool = True) -> Any:
            return kernel.stat(str(self), follow_symlinks=follow_symlinks)

        def mkdir(self, mode: int = 0o777, parents: bool = False, exist_ok: bool = False) -> None:
            make = partial(kernel.makedirs, exist_ok=exist_ok) if parents or exist_ok else kernel.mkdir
            make(str(self), mode)

        def unlink(self, missing_ok: bool = False) -> None:
            if not missing_ok or kernel.exists(str(self)):
                kernel.unlink(str(self))

        def replace(self, target: Any) -> Any:
            kernel.rename(str(self), str(target))
            return target

        rename = replace

        def iterdir(self) -> Any:
            return (self / name for name in kernel.listdir(str(self)))

        def glob(self, pattern: str) -> Iterator[Any]:  # type: ignore[override]
            if kernel.exists(str(self)):
                yield from (path for path in self.iterdir() if path.match(pattern))

        def resolve(self, strict: bool = False) -> Any:
            return self

    return DiskPath


class Output(io.TextIOBase):
    """`sys.stderr` and `sys.stdout`."""

    def __init__(self, kernel: Kernel, fd: int) -> None:
        self._kernel, self._fd = kernel, fd

    def fileno(self) -> int:
        return self._fd

    def write(self, text: str) -> int:
        return self._kernel.write(self._fd, text.encode(errors="backslashreplace"))


class _Sys:
    """`sys` with other streams, separate for each process that replaces them."""

    def __init__(self, kernel: Kernel) -> None:
        self.__dict__.update(_kernel=kernel, _usual={"stdout": Output(kernel, 1), "stderr": Output(kernel, 2)}, _own={})

    def __getattr__(self, name: str) -> Any:
        if name in self._usual:
            return self._own.get((self._kernel.me, name), self._usual[name])
        return getattr(sys, name)

    def __setattr__(self, name: str, value: Any) -> None:
        self._own[self._kernel.me, name] = value


class _Queues:
    """`SimpleQueue`, `SimpleQueue[int]` and `SimpleQueue()`."""

    def __init__(self, kernel: Kernel) -> None:
        self._time = kernel.time

    def __getitem__(self, _: object) -> "_Queues":
        return self

    def __call__(self, _size: int = 0) -> SimpleQueue[Any]:
        return SimpleQueue(self._time)


def replacements(kernel: Kernel, processes: Processes) -> dict[Any, Any]:
    """Real object → replacement."""
    time, fake = kernel.time, kernel.modules()
    processes.extend_os(fake["os"])
    event, thread, condition = partial(Event, time), partial(Thread, time), partial(Condition, time)
    lock, again, queues = partial(Lock, time), partial(Lock, time, again=True), _Queues(kernel)

    def sleep(seconds: float) -> None:
        time.wait(time.now_s + seconds)

    def wall() -> float:
        return WALL_S + kernel.clock_off_s + time.clock()

    fake_time = SimpleNamespace(**vars(real_time))
    fake_time.monotonic = fake_time.perf_counter = time.clock
    fake_time.sleep, fake_time.time, fake_time.clock_gettime = sleep, wall, lambda _: time.clock()
    fake_threading = SimpleNamespace(**vars(threading))
    fake_threading.Event, fake_threading.Thread, fake_threading.Condition = event, thread, condition
    fake_threading.Lock, fake_threading.RLock = lock, again
    fake_queue = SimpleNamespace(**vars(queue))
    fake_queue.SimpleQueue = fake_queue.Queue = queues
    return {
        os: fake["os"], fcntl: fake["fcntl"], termios: fake["termios"], select: fake["select"],
        real_time: fake_time, threading: fake_threading, queue: fake_queue, sys: _Sys(kernel),
        signal: processes.signal_module(), socket: processes.socket_module(),
        real_time.monotonic: time.clock, real_time.sleep: sleep, real_time.time: wall,
        real_time.clock_gettime: fake_time.clock_gettime,
        threading.Event: event, threading.Thread: thread, threading.Condition: condition,
        threading.Lock: lock, threading.RLock: again, queue.SimpleQueue: queues, queue.Queue: queues,
        pathlib.Path: path_class(kernel), open: partial(open_file, kernel),
        fcntl.flock: kernel.flock, fcntl.ioctl: kernel.ioctl,
    }  # fmt: skip


def exchange(stack: ExitStack, replaced: dict[Any, Any], also: dict[Any, Any]) -> None:
    """Replace the real ones in every module until the stack is closed; `also` are the product's own."""
    by_id = {id(real): fake for real, fake in (*replaced.items(), *also.items())}
    for module in modules():
        values = vars(module)
        changes: dict[str, Any] = {name: by_id[id(value)] for name, value in values.items() if id(value) in by_id}
        if module is not serial.serialposix:
            changes.setdefault("print", _printer(replaced[sys]))
        stack.enter_context(patch.multiple(module, create=True, **changes)) if changes else None
    stack.enter_context(patch.object(serial.serialutil.Timeout, "TIME", replaced[real_time].monotonic))


def _printer(fake_sys: Any) -> Callable[..., None]:
    def printer(*values: object, file: Any = None, **options: Any) -> None:
        print(*values, file=fake_sys.stdout if file is None else file, **options)

    return printer
