"""The picture of a sweep: the cost of faster charging in heat and in time at high voltage."""

from collections.abc import Callable, Iterable, Sequence
from itertools import cycle
from math import nan
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from orchestrator.workbench.simulate.figures import Figures
from orchestrator.workbench.simulate.sweep import Point, Sweep, best

#: The costs plotted against time to full.
COSTS: tuple[tuple[str, Callable[[Figures], float | None]], ...] = (
    ("peak temperature, °C", lambda f: f.peak_c),
    ("time at high voltage, h", lambda f: f.high_voltage_h),
)
#: With at most this many points, labels stay readable.
MAX_LABELS = 15
MARKERS = "os^Dv<>PX*"


def save_tradeoff(sweep: Sweep, path: Path) -> None:
    """Draw the sweep into a PNG."""
    figure = Figure(figsize=(12, 5.4), layout="constrained")
    figure.suptitle(f"{sweep.policy} on {sweep.scenario}: what time to full costs", weight="bold", x=0.02, ha="left")
    known = [point for point in sweep.points if point.figures is not None and point.figures.full_h is not None]
    values = [float(value) for value in sweep.axes[0].values]
    colours = Normalize(min(values), max(values))
    plots = figure.subplots(1, len(COSTS))
    for ax, (title, cost) in zip(plots, COSTS, strict=True):
        _scatter(ax, sweep, known, cost, colours)
        ax.set_xlabel("time to full, h")
        ax.set_title(title, loc="left", size=10)
        ax.grid(color="#e6e6e6")
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    figure.colorbar(ScalarMappable(colours), ax=plots[-1], label=sweep.axes[0].name)
    figure.savefig(path, dpi=130)


def _scatter(
    ax: Axes, sweep: Sweep, known: Sequence[Point], cost: Callable[[Figures], float | None], colours: Normalize
) -> None:
    """Colour encodes the first key, marker shape the second."""
    places = {point.values: (_value(point, lambda f: f.full_h), _value(point, cost)) for point in known}
    seconds = sweep.axes[1].values if len(sweep.axes) > 1 else ("",)
    for second, marker in zip(seconds, cycle(MARKERS), strict=False):
        same = [point for point in known if len(sweep.axes) < 2 or point.values[1] == second]
        ax.scatter(
            *_columns(places[point.values] for point in same),
            c=[float(point.values[0]) for point in same],
            norm=colours,
            marker=marker,
            s=42,
            label=f"{sweep.axes[1].name} = {second}" if second else None,
        )
    rings = _columns(places[point.values] for point in best(known))
    ax.scatter(*rings, s=120, facecolors="none", edgecolors="#d55e00", label="no other one is better in all three")
    if len(known) <= MAX_LABELS:
        for values, place in places.items():
            ax.annotate(", ".join(values), place, xytext=(7, 4), textcoords="offset points", size=8)
    ax.legend(loc="best", frameon=False, fontsize=8)


def _columns(places: Iterable[tuple[float, float]]) -> tuple[list[float], list[float]]:
    pairs = list(places)
    return [x for x, _ in pairs], [y for _, y in pairs]


def _value(point: Point, figure: Callable[[Figures], float | None]) -> float:
    value = figure(point.figures) if point.figures is not None else None
    return nan if value is None else value
