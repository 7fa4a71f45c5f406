"""The results of measurements, and the table for people."""

import json
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, inf, isfinite
from pathlib import Path

COLUMNS = ("what", "goal", "median", "p99", "n", "beside it", "median", "p99", "n", "met")


@dataclass(frozen=True, slots=True)
class Series:
    """Many runs of one measurement. `missing` is the number of runs without a result in time."""

    label: str
    samples: Sequence[float]
    missing: int = 0
    more_is_better: bool = False  #: then p99 is the value at most one run in a hundred falls below

    @property
    def median(self) -> float | None:
        """None if half of the runs have no result."""
        return _known(statistics.median(self._worst_last)) if self.n else None

    @property
    def p99(self) -> float | None:
        """The value at most one run in a hundred exceeds; None if more than that have no result."""
        return _known(self._worst_last[ceil(0.99 * self.n) - 1]) if self.n else None

    @property
    def _worst_last(self) -> list[float]:
        return [*sorted(self.samples, reverse=self.more_is_better), *[inf] * self.missing]

    @property
    def n(self) -> int:
        """All runs."""
        return len(self.samples) + self.missing


@dataclass(frozen=True, slots=True)
class Goal:
    """An upper limit: absolute in the result's unit, or as a share of the value it is compared with."""

    median: float | None = None
    p99: float | None = None
    share: float | None = None

    def met(self, ours: Series, other: Series | None) -> bool:
        """Whether every part of it holds."""
        pairs = [(ours.median, self.median), (ours.p99, self.p99)]
        if self.share is not None and other is not None:
            pairs += [(ours.median, _times(other.median, self.share)), (ours.p99, _times(other.p99, self.share))]
        return all(limit is None or (value is not None and value <= limit) for value, limit in pairs)

    def text(self, unit: str) -> str:
        """For the table."""
        parts = []
        if self.median is not None:
            parts.append(f"≤ {figure(self.median)} {unit}")
        if self.p99 is not None:
            parts.append(f"p99 ≤ {figure(self.p99)} {unit}")
        if self.share is not None:
            parts.append(f"≤ {Fraction(self.share).limit_denominator(10)} of it")
        return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class Result:
    """One row of the table: our result, the one it is compared with, and the goal."""

    what: str
    unit: str
    ours: Series
    other: Series | None = None
    goal: Goal | None = None
    processor_time: bool = False  #: proportional to the gateway factor; most others are periods, waits and memory

    @property
    def met(self) -> bool | None:
        """None without a goal."""
        return self.goal.met(self.ours, self.other) if self.goal else None

    def cells(self) -> tuple[str, ...]:
        """Its row of the table."""
        verdict = {None: "", True: "yes", False: "NO"}[self.met]
        goal = self.goal.text(self.unit) if self.goal else ""
        other = (self.other.label, *_figures(self.other, self.unit)) if self.other else ("", "", "", "")
        return (self.what, goal, *_figures(self.ours, self.unit), *other, verdict)

    def facts(self) -> dict[str, object]:
        """For programs."""
        sides = {"ours": self.ours, "beside": self.other}
        return {
            "what": self.what,
            "unit": self.unit,
            "goal": self.goal.text(self.unit) if self.goal else None,
            "met": self.met,
            **{
                side: {"label": one.label, "median": one.median, "p99": one.p99, "n": one.n, "missing": one.missing}
                for side, one in sides.items()
                if one is not None
            },
        }


def _known(value: float) -> float | None:
    return value if isfinite(value) else None


def _times(value: float | None, share: float) -> float | None:
    return None if value is None else value * share


def figure(value: float) -> str:
    """With as many digits as are worth reading."""
    digits = 0 if value >= 100 else 1 if value >= 10 else 2 if value >= 0.1 else 3
    return f"{value:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{value:.0f}"


def _figures(series: Series, unit: str) -> tuple[str, str, str]:
    said = ["never" if value is None else f"{figure(value)} {unit}" for value in (series.median, series.p99)]
    return said[0], said[1], str(series.n)


def table(results: Sequence[Result], more: Sequence[tuple[str, ...]] | None = None) -> str:
    """Aligned columns; `more` has further ones, with their heading."""
    rows: list[tuple[str, ...]] = [COLUMNS, *(result.cells() for result in results)]
    if more is not None:
        rows = [row + further for row, further in zip(rows, more, strict=True)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def write_json(path: Path, facts: Mapping[str, object], results: Sequence[Result]) -> None:
    """Everything, for programs that compare two runs."""
    document = {"machine": facts, "results": [result.facts() for result in results]}
    path.write_text(json.dumps(document, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
