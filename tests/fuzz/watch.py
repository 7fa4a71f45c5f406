"""What every target is held to: no exception, no long thought, no growing memory."""

import time
from pathlib import Path
from resource import getpagesize

from tests.fuzz.target import Target

WARM = 10_000  #: inputs after which all caches are full and every line has been reached that is reached often
EVERY = 5_000
#: More resident memory than after WARM inputs. The fuzzer's own growing corpus is in it, too.
MAX_GROWTH_MIB = 64.0
MIB = 1 << 20


class SlowError(AssertionError):
    """An input took too long."""


class GrowthError(AssertionError):
    """Memory is not given back."""


class Watch:
    """Gives inputs to a target, and looks at the clock and at the memory."""

    def __init__(self, target: Target, warm: int = WARM, every: int = EVERY) -> None:
        self._target = target
        self._warm, self._every = warm, every
        self._warm_mib = 0.0
        self.inputs = 0

    def one(self, data: bytes) -> None:
        """One input; AssertionError or whatever escapes for one that finds something."""
        began_s = time.process_time()
        self._target.one(data)
        took_s = time.process_time() - began_s
        if took_s > self._target.limit_s:
            raise SlowError(f"{took_s:.2f} s of CPU time, allowed are {self._target.limit_s:g} s")
        self.inputs += 1
        if self.inputs == self._warm:
            self._warm_mib = resident_mib()
        elif self.inputs > self._warm and self.inputs % self._every == 0:
            growth_mib = resident_mib() - self._warm_mib
            if growth_mib > MAX_GROWTH_MIB:
                raise GrowthError(f"{growth_mib:.0f} MiB more after {self.inputs} inputs than after {self._warm}")


def resident_mib() -> float:
    """This process's memory that is in use now."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * getpagesize() / MIB
