"""The time of day of what the core says in seconds of the monotonic clock. Pure: both clocks are read elsewhere."""

from dataclasses import dataclass
from math import ceil
from time import localtime, strftime
from typing import overload

from orchestrator.model import Cause
from orchestrator.text.moments import MOMENT, UNIX, with_moments

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

    @overload
    def told(self, cause: Cause) -> Cause: ...

    @overload
    def told(self, cause: None) -> None: ...

    @overload
    def told(self, cause: Cause | None) -> Cause | None: ...

    def told(self, cause: Cause | None) -> Cause | None:
        """The cause with its moments as the time of day, here."""
        return cause and with_moments(cause, self._told)

    def time_of_day(self, t_s: float, *, coming: bool = False) -> str:
        """HH:MM:SS, of another day its date and HH:MM; of what is `coming`, and not soon, HH:MM, rounded up."""
        coming, unix_s = coming and t_s - self.now_s > SOON_S, self.unix_s(t_s)
        if coming:
            unix_s = ceil(unix_s / MINUTE_S) * MINUTE_S
        then = localtime(unix_s)
        if then[:3] != localtime(self.wall_s)[:3]:
            return strftime("%Y-%m-%d %H:%M", then)
        return strftime("%H:%M" if coming else "%H:%M:%S", then)

    @property
    def stamp(self) -> str:
        """The present date and time, here."""
        return strftime("%Y-%m-%d %H:%M:%S", localtime(self.wall_s))

    def _told(self, name: str, t_s: float) -> str:
        if name.endswith(UNIX):
            return self._minute(t_s)
        return self.time_of_day(t_s, coming=name.removesuffix(MOMENT) == COMING)

    def _minute(self, unix_s: float) -> str:
        """HH:MM, of another day with its date."""
        then = localtime(unix_s)
        return strftime("%H:%M" if then[:3] == localtime(self.wall_s)[:3] else "%Y-%m-%d %H:%M", then)
