"""A moment by both clocks: the wall clock, which people read and which may step, and the monotonic one. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from orchestrator.record.utc import utc

#: A clock before this moment (2024-01-01) has never been set.
NEVER_SET_S = 1_704_067_200.0


@dataclass(frozen=True, slots=True)
class Stamp:
    """When something was, at this station."""

    unix_s: float  #: by the wall clock
    offset_min: int  #: of local time from UTC
    mono_s: float  #: by the monotonic clock …
    boot: str  #: … of this boot of the machine; "" if unknown

    def since(self, then: "Stamp") -> float:
        """The seconds from `then` until this; 0 if no clock can tell."""
        if self.boot and self.boot == then.boot:
            return max(self.mono_s - then.mono_s, 0.0)
        return max(self.unix_s - then.unix_s, 0.0) if then.unix_s >= NEVER_SET_S else 0.0

    def back(self, seconds: float) -> "Stamp":
        """The moment so long before, by both clocks."""
        return Stamp(self.unix_s - seconds, self.offset_min, self.mono_s - seconds, self.boot)

    def local(self) -> str:
        """As people at the station read it, to the second."""
        return utc(self.unix_s + self.offset_min * 60)[:19].replace("T", " ")


def as_fields(stamp: Stamp) -> dict[str, object]:
    """As it stands in a record."""
    return {
        "utc": utc(stamp.unix_s),
        "offset_min": stamp.offset_min,
        "unix_s": round(stamp.unix_s, 3),
        "mono_s": round(stamp.mono_s, 3),
        "boot": stamp.boot,
    }


def from_fields(value: object) -> Stamp:
    """The inverse; ValueError for anything else."""
    if not isinstance(value, Mapping):
        raise ValueError(f"{value!r:.80} is no moment")
    unix_s, offset_min, mono_s, boot = (value.get(name) for name in ("unix_s", "offset_min", "mono_s", "boot"))
    if not isinstance(boot, str) or not isinstance(offset_min, int):
        raise ValueError(f"{value!r:.80} is no moment")
    return Stamp(figure(unix_s), offset_min, figure(mono_s), boot)


def figure(value: object) -> float:
    """A finite number from a record; ValueError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"{value!r:.80} is no number")
    return float(value)
