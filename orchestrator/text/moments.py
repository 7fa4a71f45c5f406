"""The moments in a cause, told by the clock of those who read it.

The core knows no clock: it has moments in seconds, in parameters called `…_t_s`. What must survive a reboot has them in
Unix time, in parameters called `…_unix_s`. Told they are called `…_at`.
"""

from collections.abc import Callable
from math import isfinite

from orchestrator.model import Cause

MOMENT, UNIX, TIME_OF_DAY = "_t_s", "_unix_s", "_at"


def with_moments(cause: Cause, tell: Callable[[str, float], str]) -> Cause:
    """The cause with every moment, at any depth, as `tell(its name, its seconds)`."""
    pairs = tuple(_pair(name, value, tell) for name, value in cause.params)
    return Cause(cause.id, pairs, cause.key, cause.place, cause.advice)


def _pair(name: str, value: object, tell: Callable[[str, float], str]) -> tuple[str, object]:
    if name.endswith((MOMENT, UNIX)) and isinstance(value, int | float) and isfinite(value):
        return told_as(name), tell(name, value)
    return name, _value(value, tell)


def told_as(name: str) -> str:
    """What a moment's parameter is called once it is the time of day."""
    return f"{name.removesuffix(MOMENT).removesuffix(UNIX)}{TIME_OF_DAY}"


def _value(value: object, tell: Callable[[str, float], str]) -> object:
    if isinstance(value, Cause):
        return with_moments(value, tell)
    return tuple(_value(one, tell) for one in value) if isinstance(value, tuple) else value
