"""The figures of an earlier run, as further columns of the table: from this machine or, scaled, from another one."""

import json
from argparse import ArgumentTypeError
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path

from benchmarks import gateway
from benchmarks.report import Result, figure

COLUMNS = ("before", "change")
EXPECTED = "expected a file that `python -m benchmarks --json FILE` of this version wrote"


@dataclass(frozen=True, slots=True)
class Before:
    """An earlier run: its machine's gateway factor, and each row's median, which is None for *never*."""

    factor: float
    medians: Mapping[tuple[str, str], float | None]  #: by row and unit

    def columns(self, results: Sequence[Result], factor: float) -> Iterator[tuple[str, ...]]:
        """A heading, then what belongs beside each result; `factor` is this machine's."""
        yield COLUMNS
        for result in results:
            if (result.what, result.unit) in self.medians:
                yield self._beside(result, factor)
            else:
                yield "", ""

    def _beside(self, result: Result, factor: float) -> tuple[str, str]:
        before, now = self.medians[result.what, result.unit], result.ours.median
        if before is None:
            return "never", ""
        if result.processor_time:
            before *= factor / self.factor
        change = f"{round(100 * (now / before - 1)):+d} %" if now is not None and before else ""
        return f"{figure(before)} {result.unit}", change.replace("-", "−")


def load(name: str) -> Before:
    """Read a file of `--json`; the error says what is wrong with it."""
    try:
        document = json.loads(Path(name).read_text(encoding="utf-8"))
    except OSError as error:
        raise ArgumentTypeError(f"{name} cannot be read ({error.strerror}); {EXPECTED}") from error
    except (ValueError, RecursionError) as error:
        raise ArgumentTypeError(f"{name} is not JSON; {EXPECTED}") from error
    try:
        machine, rows = document["machine"], document["results"]
        if gateway.FACT not in machine:
            raise ArgumentTypeError(f"{name} is from an older version, without a {gateway.FACT}; {EXPECTED}")
        medians = {(str(row["what"]), str(row["unit"])): row["ours"]["median"] for row in rows}
        known = [value for value in medians.values() if value is not None]
        if not all(isfinite(value) and value >= 0 for value in known) or not 0 < machine[gateway.FACT] < inf:
            raise ValueError
    except (LookupError, TypeError, ValueError, OverflowError) as error:
        raise ArgumentTypeError(f"{name} has another form; {EXPECTED}") from error
    return Before(machine[gateway.FACT], medians)
