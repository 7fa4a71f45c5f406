"""`threading` and `queue`, as used by the service, in virtual time."""

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from queue import Empty
from typing import Generic, TypeVar

from tests.proof.virtual_time import Runner, Time

T = TypeVar("T")


class Waiting:
    """The threads waiting for one event."""

    def __init__(self, time: Time) -> None:
        self._time = time
        self.waiting: list[Runner] = []

    def wait(self, timeout_s: float | None) -> None:
        me = self._time.me()
        self.waiting.append(me)
        try:
            self._time.wait(inf if timeout_s is None else self._time.now_s + max(timeout_s, 0.0))
        finally:
            self.waiting.remove(me)

    def wake(self) -> None:
        for runner in self.waiting:
            self._time.wake(runner)


class Lock:
    """`threading.Lock` and `threading.RLock`."""

    def __init__(self, time: Time, *, again: bool = False) -> None:
        self._time, self._again = time, again
        self._holder: Runner | None = None
        self._depth = 0
        self._waiting = Waiting(time)

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        me = self._time.me()
        end_s = inf if timeout < 0 else self._time.now_s + timeout
        while self._holder is not None and not (self._again and self._holder is me):
            if not blocking or self._time.now_s >= end_s:
                return False
            self._waiting.wait(end_s - self._time.now_s if end_s < inf else None)
        self._holder, self._depth = me, self._depth + 1
        return True

    def release(self) -> None:
        self._depth -= 1
        if not self._depth:
            self._holder = None
            self._waiting.wake()

    def locked(self) -> bool:
        return self._holder is not None

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()


class Condition:
    """`threading.Condition`."""

    def __init__(self, time: Time, lock: Lock | None = None) -> None:
        self._time, self._lock = time, lock or Lock(time, again=True)
        self._waiting = Waiting(time)
        self.acquire, self.release = self._lock.acquire, self._lock.release

    def __enter__(self) -> bool:
        return self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def wait(self, timeout: float | None = None) -> bool:
        began_s = self._time.now_s
        self._lock.release()
        try:
            self._waiting.wait(timeout)
        finally:
            self._lock.acquire()
        return timeout is None or self._time.now_s < began_s + timeout

    def wait_for(self, predicate: Callable[[], object], timeout: float | None = None) -> bool:
        end_s = inf if timeout is None else self._time.now_s + timeout
        while not predicate():
            if self._time.now_s >= end_s:
                return False
            self.wait(None if timeout is None else end_s - self._time.now_s)
        return True

    def notify(self, _count: int = 1) -> None:
        self._waiting.wake()

    notify_all = notify


class Event:
    """`threading.Event`."""

    def __init__(self, time: Time) -> None:
        self._waiting = Waiting(time)
        self._set = False

    def is_set(self) -> bool:
        return self._set

    def set(self) -> None:
        self._set = True
        self._waiting.wake()

    def clear(self) -> None:
        self._set = False

    def wait(self, timeout: float | None = None) -> bool:
        if not self._set:
            self._waiting.wait(timeout)
        return self._set


class Thread:
    """`threading.Thread`."""

    def __init__(
        self, time: Time, target: Callable[..., object], name: str = "", daemon: bool = True,
        args: tuple[object, ...] = (), kwargs: Mapping[str, object] | None = None,
    ) -> None:  # fmt: skip
        self._time, self._target = time, partial(target, *args, **(kwargs or {}))
        self.name, self.daemon = name, daemon
        self._runner: Runner | None = None
        self._ending = Waiting(time)

    def start(self) -> None:
        self._runner = self._time.start(self._run)

    def _run(self) -> None:
        try:
            self._target()
        finally:
            self._ending.wake()

    def is_alive(self) -> bool:
        return self._runner is not None and not self._runner.ended

    def join(self, timeout: float | None = None) -> None:
        if self.is_alive():
            self._ending.wait(timeout)


class SimpleQueue(Generic[T]):
    """`queue.SimpleQueue`."""

    def __init__(self, time: Time) -> None:
        self._waiting = Waiting(time)
        self._items: deque[T] = deque()

    def put(self, item: T) -> None:
        self._items.append(item)
        self._waiting.wake()

    def get(self, timeout: float | None = None) -> T:
        if not self._items:
            self._waiting.wait(timeout)
        return self.get_nowait()

    def get_nowait(self) -> T:
        if not self._items:
            raise Empty
        return self._items.popleft()

    def empty(self) -> bool:
        return not self._items

    def qsize(self) -> int:
        return len(self._items)
