"""`threading` and `queue` as the service uses them, in virtual time."""

from collections import deque
from collections.abc import Callable
from math import inf
from queue import Empty
from typing import Generic, TypeVar

from tests.proof.virtual_time import Runner, Time

T = TypeVar("T")


class Waiting:
    """Those who wait for one thing."""

    def __init__(self, time: Time) -> None:
        self._time = time
        self._waiting: list[Runner] = []

    def wait(self, timeout_s: float | None) -> None:
        me = self._time.me()
        self._waiting.append(me)
        try:
            self._time.wait(inf if timeout_s is None else self._time.now_s + max(timeout_s, 0.0))
        finally:
            self._waiting.remove(me)

    def wake(self) -> None:
        for runner in self._waiting:
            self._time.wake(runner)


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

    def __init__(self, time: Time, target: Callable[[], object], name: str = "", daemon: bool = True) -> None:
        self._time, self._target = time, target
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
