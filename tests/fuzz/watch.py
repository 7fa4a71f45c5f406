"""Requirements for every target: no exception, no long computation, no growing memory."""

import signal
from pathlib import Path
from resource import getpagesize
from types import FrameType

from tests.fuzz.target import Target

WARM = 10_000  #: inputs until all caches are full and all common lines have been reached
EVERY = 5_000
#: Allowed growth of resident memory after WARM inputs, with the fuzzer's own growing corpus.
MAX_GROWTH_MIB = 64.0
MIB = 1 << 20


class SlowError(AssertionError):
    """An input took too long or would never end."""


class GrowthError(AssertionError):
    """Memory is not released."""


class Watch:
    """Runs inputs on a target and watches its CPU time (not its waiting) and its memory."""

    def __init__(self, target: Target, warm: int = WARM, every: int = EVERY) -> None:
        self._target = target
        self._warm, self._every = warm, every
        self._warm_mib = 0.0
        self._late = False
        self.inputs = 0
        signal.signal(signal.SIGVTALRM, self._time_is_up)

    def one(self, data: bytes) -> None:
        """One input; raises AssertionError or whatever escapes for a finding."""
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
        self._late = True  # the hanging code may catch what is raised here
        raise self._slow()

    def _slow(self) -> SlowError:
        return SlowError(f"an input takes more than {self._target.limit_s:g} s of CPU time")


def resident_mib() -> float:
    """The memory this process uses now."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * getpagesize() / MIB
