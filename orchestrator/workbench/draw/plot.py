"""The picture of one or more simulations on one scenario: measured values, step, state and limiting rule."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from io import StringIO
from math import nan
from pathlib import Path
from typing import Literal

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from orchestrator.model import State
from orchestrator.workbench.simulate.compare import differences
from orchestrator.workbench.simulate.figures import titles
from orchestrator.workbench.simulate.simulation import Run
from orchestrator.workbench.simulate.trail import Bound, Moment, Span, bounds, clock_s

#: One colour per policy, safe for colour-blind readers (Okabe and Ito); further policies repeat them with other dashes.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
DASHES: tuple[Literal["-", "--", ":"], ...] = ("-", "--", ":")
STATE_COLOURS: dict[State, str] = {
    State.STARTING: "#e0e0e0",
    State.OFFLINE: "#bdbdbd",
    State.IDLE: "#eeeeee",
    State.HELD: "#f4cccc",
    State.QUALIFYING: "#d9d2e9",
    State.PRECHARGE_PULSE: "#9fc5e8",
    State.PRECHARGE_CONTINUOUS: "#6fa8dc",
    State.CHARGING: "#a8d5a2",
    State.FULL: "#5fae57",
    State.SUSPENDED: "#ffe08a",
    State.STOPPING: "#f4b183",
    State.TRIPPED: "#e57373",
    State.UNCONTROLLABLE: "#b71c1c",
}
#: The curves, top down: title, and value at a moment.
PANELS: tuple[tuple[str, Callable[[Moment], float | None]], ...] = (
    ("state of charge, %", lambda m: m.soc_pct),
    ("pack voltage, V", lambda m: m.voltage_v),
    ("current, A", lambda m: m.current_a),
    ("temperature, °C", lambda m: m.temperature_c),
    ("current step", lambda m: m.step + 1 if m.step is not None else None),
)
HEIGHTS = (3.0, 2.4, 2.4, 2.4, 1.3)
WIDTH_IN = 12.0
#: Rules that fit in the picture, in total and at least per policy; characters per rule; share of time worth showing.
MAX_RULES, MIN_RULES, MAX_CHARACTERS, TELLING_SHARE = 16, 5, 190, 0.001
#: The width of a stretch of the band that fits a number, or a state's name, as a share of the whole.
NUMBER_SHARE, NAME_SHARE = 0.012, 0.08


@dataclass(frozen=True, slots=True)
class Drawing:
    """A picture as SVG text, and the position of its time axis."""

    svg: str
    left: float  #: position of hour 0, as a share of the width
    right: float  #: … and of the last hour


def _style() -> AbstractContextManager[None]:
    return mpl.rc_context(
        {
            "font.size": 9,
            "axes.titlesize": 9,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.grid": True,
            "grid.color": "#e6e6e6",
            "svg.fonttype": "none",  # keep text as text, for searching and copying
            "svg.hashsalt": "orchestrator",  # make the picture reproducible
        }
    )


def save_png(runs: Sequence[Run], path: Path) -> None:
    """Save the picture with the rules below it."""
    with _style():
        _draw(runs, whole=True).savefig(path, dpi=130)


def svg(runs: Sequence[Run]) -> Drawing:
    """The picture without title and rules, for a page that shows them as text."""
    with _style():
        figure, text = _draw(runs, whole=False), StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
        box = figure.axes[0].get_position()
    return Drawing(text.getvalue()[text.getvalue().index("<svg") :], box.x0, box.x1)


def _draw(runs: Sequence[Run], *, whole: bool) -> Figure:
    told = [_worth_telling(run, max(MAX_RULES // len(runs), MIN_RULES)) for run in runs]
    band_in, rules_in = 0.32 * len(runs) + 0.1, sum(0.19 * len(rules) + 0.3 for rules in told) if whole else 0.0
    heights = [*(0.62 * height for height in HEIGHTS), band_in]
    top_in = 0.95 if whole else 0.6
    height_in = sum(heights) * 1.22 + top_in + 0.25 + rules_in
    figure = Figure(figsize=(WIDTH_IN, height_in))
    axes = figure.subplots(len(heights), 1, sharex=True, gridspec_kw={"height_ratios": heights, "hspace": 0.3})
    figure.subplots_adjust(left=0.055, right=0.985, top=1 - top_in / height_in, bottom=(0.45 + rules_in) / height_in)
    scenario = runs[0].scenario
    if whole:
        title = f"{scenario.scenario}: {scenario.about}"
        figure.text(0.055, 1 - 0.2 / height_in, title, size=12, weight="bold", va="top")
    _legend(figure, runs, 1 - (top_in - 0.53) / height_in)
    for ax, (title, _) in zip(axes, PANELS, strict=False):
        ax.set_title(title, loc="left", pad=3, color="#444444")
    for number, run in enumerate(runs):
        _curves(axes, run, number)
        _band(axes[-1], run, number)
    _finish(axes, runs)
    if whole:
        _rules(figure, runs, told, height_in, rules_in)
    return figure


def _worth_telling(run: Run, room: int) -> list[Bound]:
    """The rules in force for a noticeable time; the longest if there are too many."""
    told = [bound for bound in bounds(run.trail.spans) if bound.total_s > run.scenario.hours * 3600 * TELLING_SHARE]
    longest = sorted(told, key=lambda bound: -bound.total_s)[:room]
    return [bound for bound in told if bound in longest]


def _look(number: int) -> tuple[str, Literal["-", "--", ":"]]:
    return COLOURS[number % len(COLOURS)], DASHES[number // len(COLOURS) % len(DASHES)]


def colour(number: int) -> str:
    """The colour of the policy with this number, from 0."""
    return COLOURS[number % len(COLOURS)]


def _legend(figure: Figure, runs: Sequence[Run], top: float) -> None:
    handles = [
        Line2D([], [], color=_look(number)[0], linestyle=_look(number)[1], label=title)
        for number, title in enumerate(titles(runs))
    ]
    handles.append(Line2D([], [], color="#999999", linewidth=0.9, linestyle="--", label="surroundings"))
    if len(runs) > 1:
        handles.append(Line2D([], [], color="#000000", alpha=0.07, linewidth=7, label="the policies differ"))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.05, top), ncols=len(handles), frameon=False)


def _curves(axes: Sequence[Axes], run: Run, number: int) -> None:
    moments = run.trail.moments
    hours = [m.t_s / 3600 for m in moments]
    colour, dash = _look(number)
    for ax, (_, value) in zip(axes, PANELS, strict=False):
        values = [nan if (y := value(m)) is None else y for m in moments]
        stepped = ax is axes[len(PANELS) - 1]
        ax.plot(hours, values, color=colour, linestyle=dash, linewidth=1.4, drawstyle="steps-pre" if stepped else None)
    if number == 0:
        axes[3].plot(hours, [m.ambient_c for m in moments], color="#999999", linewidth=0.9, linestyle="--")


def _band(ax: Axes, run: Run, number: int) -> None:
    """The states as a band, one row per policy from top to bottom; numbers refer to the rules."""
    whole_h = run.scenario.hours
    for bound in bounds(run.trail.spans):
        boxes = [(span.from_s / 3600, (span.to_s - span.from_s) / 3600) for span in bound.spans]
        state = bound.spans[0].state
        ax.broken_barh(boxes, (-number - 0.9, 0.8), color=STATE_COLOURS[state], edgecolor="white", linewidth=0.4)
        for from_h, hours in boxes:
            if hours > whole_h * NUMBER_SHARE:
                label = f"{bound.number} {state}" if hours > whole_h * NAME_SHARE else str(bound.number)
                ax.text(from_h + hours / 2, -number - 0.5, label, size=7, ha="center", va="center", clip_on=True)


def _finish(axes: Sequence[Axes], runs: Sequence[Run]) -> None:
    *curves, band = axes
    for ax in curves:
        for from_s, to_s in differences([run.trail.spans for run in runs]):
            ax.axvspan(from_s / 3600, to_s / 3600, color="#000000", alpha=0.05, linewidth=0)
    curves[-1].set_ylim(0.7, 5.3)
    curves[-1].set_yticks(range(1, 6))
    band.set_ylim(-len(runs), 0)
    band.set_yticks([])
    band.grid(visible=False)
    band.spines["left"].set_visible(False)
    band.set_title("state", loc="left", pad=3, color="#444444")
    band.set_xlim(0, runs[0].scenario.hours)
    band.set_xlabel("hours", labelpad=1)


def _rules(
    figure: Figure, runs: Sequence[Run], told: Sequence[Sequence[Bound]], height_in: float, rules_in: float
) -> None:
    y_in = rules_in
    for number, (name, rules) in enumerate(zip(titles(runs), told, strict=True)):
        title = f"{name}: what bound it, and where that stands"
        figure.text(0.055, y_in / height_in, title, size=9, weight="bold", va="top", color=_look(number)[0])
        for line, bound in enumerate(rules, start=1):
            text = f"{bound.number}   {when(bound)}   {says(bound.spans[0])}"
            short = text if len(text) <= MAX_CHARACTERS else f"{text[: MAX_CHARACTERS - 1]}…"
            figure.text(0.055, (y_in - 0.19 * line) / height_in, short, size=8, va="top")
        y_in -= 0.19 * len(rules) + 0.3


def when(bound: Bound) -> str:
    """The first and last time of a rule; with its count and total duration, if it was in force several times."""
    first, last, times = bound.spans[0], bound.spans[-1], len(bound.spans)
    often = f" ({times} times, {clock_s(bound.total_s / 3600)})" if times > 1 else ""
    return f"{clock_s(first.from_s / 3600)} … {clock_s(last.to_s / 3600)}{often}"


def says(span: Span) -> str:
    """State, step and rule in one line."""
    step = f", step {span.step + 1} ({span.step_a:.1f} A)" if span.step is not None else ""
    return f"{span.state}{step}: {span.why}"
