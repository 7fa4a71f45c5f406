"""The time of day of what the core says in seconds of the monotonic clock. Pure: both clocks are read elsewhere.

Such moments are parameters called `…_t_s`, at any depth; told to people and programs outside they are called `…_at`.
"""

from dataclasses import dataclass
from math import ceil, isfinite
from time import localtime, strftime

from orchestrator.model import Cause

MOMENT, TIME_OF_DAY = "_t_s", "_at"
#: What is to come is told in minutes, and never too early.
COMING, MINUTE_S, SOON_S = "until", 60.0, 120.0


@dataclass(frozen=True, slots=True)
class WallClock:
    """What both clocks say at one moment."""

    now_s: float
    wall_s: float

    def unix_s(self, t_s: float) -> float:
        """The Unix time of a monotonic moment."""
        return self.wall_s - (self.now_s - t_s)

    def told(self, cause: Cause | None) -> Cause | None:
        """The cause with its moments as the time of day, here."""
        if cause is None:
            return None
        pairs = tuple(self._pair(name, value) for name, value in cause.params)
        return Cause(cause.id, pairs, cause.key, cause.place, cause.advice)

    def time_of_day(self, t_s: float, *, coming: bool = False) -> str:
        """HH:MM:SS, of another day its date and HH:MM; of what is `coming`, and not soon, HH:MM, rounded up."""
        coming, unix_s = coming and t_s - self.now_s > SOON_S, self.unix_s(t_s)
        if coming:
            unix_s = ceil(unix_s / MINUTE_S) * MINUTE_S
        then = localtime(unix_s)
        if then[:3] != localtime(self.wall_s)[:3]:
            return strftime("%Y-%m-%d %H:%M", then)
        return strftime("%H:%M" if coming else "%H:%M:%S", then)

    def _pair(self, name: str, value: object) -> tuple[str, object]:
        if name.endswith(MOMENT) and isinstance(value, int | float) and isfinite(value):
            name = name.removesuffix(MOMENT)
            return f"{name}{TIME_OF_DAY}", self.time_of_day(value, coming=name == COMING)
        return name, self._value(value)

    def _value(self, value: object) -> object:
        if isinstance(value, Cause):
            return self.told(value)
        return tuple(map(self._value, value)) if isinstance(value, tuple) else value
