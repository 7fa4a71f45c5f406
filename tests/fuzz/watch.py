"""What every target is held to: no exception, no long thought, no growing memory."""

import signal
from pathlib import Path
from resource import getpagesize
from types import FrameType

from tests.fuzz.target import Target

WARM = 10_000  #: inputs after which all caches are full and every line has been reached that is reached often
EVERY = 5_000
#: More resident memory than after WARM inputs. The fuzzer's own growing corpus is in it, too.
MAX_GROWTH_MIB = 64.0
MIB = 1 << 20


class SlowError(AssertionError):
    """An input took too long, or would take for ever."""


class GrowthError(AssertionError):
    """Memory is not given back."""


class Watch:
    """Gives inputs to a target, and looks at the time that it computes (not waits) and at the memory."""

    def __init__(self, target: Target, warm: int = WARM, every: int = EVERY) -> None:
        self._target = target
        self._warm, self._every = warm, every
        self._warm_mib = 0.0
        self._late = False
        self.inputs = 0
        signal.signal(signal.SIGVTALRM, self._time_is_up)

    def one(self, data: bytes) -> None:
        """One input; AssertionError or whatever escapes for one that finds something."""
        signal.setitimer(signal.ITIMER_VIRTUAL, self._target.limit_s)
        try:
            self._target.one(data)
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        if self._late:
            raise self._slow()
        self.inputs += 1
        if self.inputs == self._warm:
            self._warm_mib = resident_mib()
        elif self.inputs > self._warm and self.inputs % self._every == 0:
            growth_mib = resident_mib() - self._warm_mib
            if growth_mib > MAX_GROWTH_MIB:
                raise GrowthError(f"{growth_mib:.0f} MiB more after {self.inputs} inputs than after {self._warm}")

    def _time_is_up(self, _number: int, _frame: FrameType | None) -> None:
        self._late = True  # what is raised here may be caught by what is hanging
        raise self._slow()

    def _slow(self) -> SlowError:
        return SlowError(f"an input takes more than {self._target.limit_s:g} s of CPU time")


def resident_mib() -> float:
    """This process's memory that is in use now."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * getpagesize() / MIB
