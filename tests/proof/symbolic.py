"""The product's own functions on symbolic numbers: every path that they can take, each with its condition, for z3.

A comparison of symbolic numbers is decided one way, and on another run the other way, as long as both are possible.
"""

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import z3

T = TypeVar("T")


class Paths:
    """Runs a function once for each path through it."""

    def __init__(self, *given: Any) -> None:
        self._solver = z3.Solver()
        self._solver.add(*given)
        self._script: list[tuple[bool, bool]] = []  # each decision, and whether the other one is possible as well
        self._at = 0

    def decide(self, condition: Any) -> bool:
        """One way or the other; a way that the path so far rules out is not taken."""
        if self._at == len(self._script):
            yes, no = self._possible(condition), self._possible(z3.Not(condition))
            self._script.append((yes, yes and no))
        took = self._script[self._at][0]
        self._at += 1
        self._solver.add(condition if took else z3.Not(condition))
        return took

    def of(self, run: Callable[[], T]) -> Iterator[T]:
        """The results of all paths. While one is looked at, `never` speaks of it alone."""
        while True:
            self._solver.push()
            self._at = 0
            yield run()
            other = self._next()
            self._solver.pop()
            if not other:
                return

    def never(self, condition: Any) -> bool:
        """Whether this cannot be on the path that was just taken."""
        return not self._possible(condition)

    def _possible(self, condition: Any) -> bool:
        return bool(self._solver.check(condition) == z3.sat)

    def _next(self) -> bool:
        """The next path: the last decision that was yes becomes no."""
        while self._script and not self._script[-1][1]:
            self._script.pop()
        if self._script:
            self._script[-1] = (False, False)
        return bool(self._script)


class Watts:
    """A symbolic whole number of watts that the product computes with."""

    def __init__(self, paths: Paths, value: Any) -> None:
        self._paths, self.value = paths, value

    def _with(self, value: Any) -> "Watts":
        return Watts(self._paths, value)

    def __add__(self, other: Any) -> "Watts":
        return self._with(self.value + plain(other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Watts":
        return self._with(self.value - plain(other))

    def __gt__(self, other: Any) -> bool:
        return self._paths.decide(self.value > plain(other))


def plain(value: Any) -> Any:
    """What z3 computes with."""
    return value.value if isinstance(value, Watts) else value
