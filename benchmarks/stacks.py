"""The raw stacks of `py-spy record --threads --format raw`, as shares of functions.

Only threads that hold the GIL are sampled. py-spy takes every thread that is ready to run for a running one, and on a
busy machine most of those only wait for a core, in whatever call they slept in before.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from benchmarks.threads import ROLES, role

#: A line: the thread, its stack from the outermost frame on, the number of samples.
LINE = re.compile(r"thread \(\w+\)(?:: (?P<thread>[^;]*))?;(?P<frames>.+) (?P<samples>\d+)")
LINE_NUMBER = re.compile(r":\d+\)$")
FUNCTIONS = 12  #: of each role, in each list
FEWEST = 20  #: samples that are worth a list
TRUNK = 0.8  #: what is in most stacks of a thread is its loop, and says nothing


@dataclass(slots=True)
class Samples:
    """Of one kind of thread."""

    total: int = 0
    innermost: Counter[str] = field(default_factory=Counter)
    anywhere: Counter[str] = field(default_factory=Counter)

    def alone(self) -> list[tuple[str, float]]:
        """The functions that take most themselves, with their shares."""
        return [(name, number / self.total) for name, number in self.innermost.most_common(FUNCTIONS)]

    def with_calls(self) -> list[tuple[str, float]]:
        """Those that take most with all that they call."""
        branches = [(name, number / self.total) for name, number in self.anywhere.most_common()]
        return [(name, share) for name, share in branches if share < TRUNK][:FUNCTIONS]


def by_role(lines: Iterable[str]) -> dict[str, Samples]:
    """The samples of each role."""
    found: dict[str, Samples] = {}
    for thread, frames, samples in _parsed(lines):
        of = found.setdefault(role(thread), Samples())
        of.total += samples
        of.innermost[frames[-1]] += samples
        of.anywhere.update(dict.fromkeys(frames, samples))
    return found


def _parsed(lines: Iterable[str]) -> Iterator[tuple[str, list[str], int]]:
    """Lines that are no stacks, as a sampler that does not pause its process sometimes writes, are left out."""
    for line in lines:
        if match := LINE.fullmatch(line.strip()):
            frames = [LINE_NUMBER.sub(")", frame) for frame in match["frames"].split(";")]
            yield match["thread"] or "", frames, int(match["samples"])


def rows(found: Mapping[str, Samples]) -> Iterator[str]:
    """For each role with enough samples, the functions that take most, alone and with what they call."""
    for said in ROLES.values():
        of = found.get(said, Samples())
        if of.total < FEWEST:
            yield f"\n{said}: {of.total} samples, too few for a list"
            continue
        for how, shares in (("alone", of.alone()), ("with what they call", of.with_calls())):
            yield f"\n{said}: {of.total} samples, functions {how}"
            yield from (f"{100 * share:6.1f} %  {name}" for name, share in shares)
