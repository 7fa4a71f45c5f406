"""Tries many values of a policy's keys on one scenario: which charges faster, cooler, or at a lower voltage."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import product

from orchestrator.columns import aligned, folded
from orchestrator.config.load import load_policy
from orchestrator.config.scenario import Scenario
from orchestrator.errors import OrchestratorError, UsageError
from orchestrator.extras import install_extra
from orchestrator.workbench.simulate.figures import ROWS, Figures, figures
from orchestrator.workbench.simulate.simulation import rules_of, simulate

#: `key=a..b:n`; commas join keys that share a value.
_FORM = re.compile(r"(?P<keys>[^=]+)=(?P<low>-?[\d.]+)\.\.(?P<high>-?[\d.]+):(?P<count>\d+)")
#: More than this is a typing error.
MAX_POINTS = 100_000
#: Points handed to a process at a time.
CHUNK = 8
#: How long to wait for a cluster.
CONNECT_S = 10


class ClusterError(OrchestratorError):
    """There is no Dask cluster, or Dask is not installed."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One key, or several that share a value, and the values to try."""

    keys: tuple[str, ...]
    values: tuple[str, ...]

    @property
    def name(self) -> str:
        """Its name in tables: the first key represents the others."""
        return self.keys[0] + (f" (and {len(self.keys) - 1} more)" if len(self.keys) > 1 else "")


@dataclass(frozen=True, slots=True)
class Point:
    """One combination of values, and its result: figures, or the reason these values are invalid."""

    values: tuple[str, ...]  #: one per axis
    figures: Figures | None
    refused: str = ""


def axis(text: str) -> Axis:
    """The axis for `key=a..b:n`: n values from a to b. Raises UsageError."""
    match = _FORM.fullmatch(text)
    try:
        if match is None:
            raise ValueError
        low, high, count = float(match["low"]), float(match["high"]), int(match["count"])
    except ValueError:
        raise UsageError(f"--sweep {text}: write KEY=FROM..TO:COUNT, e.g. finish.target_soc_pct=80..100:5") from None
    if not 2 <= count <= MAX_POINTS:
        raise UsageError(f"--sweep {text}: {count} values; write 2 … {MAX_POINTS}")
    values = (low + (high - low) * i / (count - 1) for i in range(count))
    return Axis(tuple(match["keys"].split(",")), tuple(f"{value:.6f}".rstrip("0").rstrip(".") for value in values))


@dataclass(frozen=True, slots=True)
class Sweep:
    """A completed sweep."""

    policy: str
    scenario: str
    axes: tuple[Axis, ...]
    points: tuple[Point, ...]


def played(
    policy: str, scenario: Scenario, axes: Sequence[Axis], pool: Executor, watch: Callable[[str, float], None]
) -> Sweep:
    """Play every combination of the axes' values in the pool; the policy is a shipped name or a path.

    `watch` is called with the policy's name and the share that is done. Raises ConfigError for errors in the policy
    itself, UnsuitableError if it does not suit the scenario, UsageError for too many points.
    """
    combinations = list(product(*(one.values for one in axes)))
    if len(combinations) > MAX_POINTS:
        raise UsageError(f"--sweep: {len(combinations)} combinations; at most {MAX_POINTS} at a time")
    as_it_is = load_policy(policy)
    rules_of(as_it_is, scenario)
    points = []
    for point in pool.map(partial(_try, policy, scenario, tuple(axes)), combinations, chunksize=CHUNK):
        points.append(point)
        watch(as_it_is.policy, len(points) / len(combinations))
    return Sweep(as_it_is.policy, scenario.scenario, tuple(axes), tuple(points))


def _try(policy: str, scenario: Scenario, axes: tuple[Axis, ...], values: tuple[str, ...]) -> Point:
    changes = {key: value for one, value in zip(axes, values, strict=True) for key in one.keys}
    try:
        changed = load_policy(policy, changes=changes)
        return Point(values, figures(simulate(changed, scenario)))
    except OrchestratorError as error:
        return Point(values, None, str(error).splitlines()[0])


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The workers of a Dask cluster. Raises ClusterError if there is none at that address, or no Dask here."""
    try:
        from distributed import Client  # noqa: PLC0415 - a separate extra, for those who have a cluster
    except ImportError:
        raise ClusterError(f"--dask needs the package distributed: {install_extra('dask')}") from None
    try:
        client = Client(address, timeout=CONNECT_S)  # type: ignore[no-untyped-call]  # it has no annotations
    except (OSError, ValueError) as error:
        raise ClusterError(f"--dask {address}: no cluster answers there: {error}") from None
    with client:
        yield client.get_executor()  # type: ignore[no-untyped-call]  # as above


def as_table(sweep: Sweep, width: int = 0) -> str:
    """All points, for a terminal of this width (0: unlimited), and below why values were refused."""
    errors = [folded(f"refused: {number}: {error}", width) for number, error in enumerate(refusals(sweep), start=1)]
    return "\n".join([aligned(rows(sweep), width, len(sweep.axes)), *errors])


def rows(sweep: Sweep) -> list[list[str]]:
    """A row per point, a column per axis and figure; the first row has the headings."""
    head, told = [*(one.name for one in sweep.axes), *(name for name, _ in ROWS)], refusals(sweep)
    return [head, *([*point.values, *_told(point, told)] for point in sweep.points)]


def refusals(sweep: Sweep) -> list[str]:
    """The errors for refused values, each once; the table has their numbers, from 1."""
    return list(dict.fromkeys(point.refused for point in sweep.points if point.figures is None))


def _told(point: Point, told: Sequence[str]) -> list[str]:
    if point.figures is None:
        return [f"refused: {told.index(point.refused) + 1}", *[""] * (len(ROWS) - 1)]
    return [tell(point.figures) for _, tell in ROWS]


def best(points: Sequence[Point]) -> list[Point]:
    """The points that no other beats in time to full, peak temperature and time at high voltage at once."""
    weighed = [(point, costs) for point in points if point.figures and (costs := _costs(point.figures))]
    return [
        point
        for point, mine in weighed
        if not any(other != mine and all(o <= m for o, m in zip(other, mine, strict=True)) for _, other in weighed)
    ]


def _costs(found: Figures) -> tuple[float, float, float] | None:
    if found.full_h is None or found.peak_c is None:
        return None
    return round(found.full_h, 3), round(found.peak_c, 2), round(found.high_voltage_h, 3)


def record(axes: Sequence[Axis], point: Point) -> Mapping[str, object]:
    """One point as numbers, for a machine-readable file."""
    found = point.figures
    return {
        **{one.name: value for one, value in zip(axes, point.values, strict=True)},
        "full_h": found and found.full_h,
        "full": found and found.full,
        "visits": found and found.visits,
        "left_pct": found and found.left_pct,
        "charged_ah": found and found.charged_ah,
        "peak_c": found and found.peak_c,
        "high_voltage_h": found and found.high_voltage_h,
        "stops": found and found.stops,
        "step_changes": found and found.step_changes,
        "refused": point.refused,
    }
