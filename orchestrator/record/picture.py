"""The curve of a charge as SVG: a panel each for SOC, volts, amperes and temperature over one time. Pure."""

from collections.abc import Iterator, Sequence
from html import escape

from orchestrator.core.states import ENERGISED
from orchestrator.model import Cause
from orchestrator.record.points import Point
from orchestrator.text.catalogue import say

#: Label, and the values in it with their colours: the battery's first.
BATTERY, CHARGER = "#2a78c2", "#d9822b"
PANELS = (
    ("curve_soc", (("soc_pct", BATTERY),)),
    ("curve_volts", (("pack_v", BATTERY), ("charger_v", CHARGER))),
    ("curve_amps", (("pack_a", BATTERY), ("charger_a", CHARGER))),
    ("curve_temperature", (("temperature_c", BATTERY),)),
)
WIDTH, PANEL, LEFT, RIGHT, TOP, FOOT = 560, 130, 56, 540, 26, 28
#: No more points are drawn of a line: its lowest and its highest of each stretch.
MOST = 600
#: Marks of the time, at most so many.
MARKS, EVERY_MIN = 8, (1, 2, 5, 10, 15, 30, 60, 120, 240, 480, 1440, 2880, 10_080, 43_200)
#: A line is not drawn over a longer time without a point.
GAP_S = 1800.0
ENERGISED_NAMES = frozenset(state.value for state in ENERGISED)

Line = list[tuple[float, float]]


def svg(points: Sequence[Point], language: str) -> str:
    """The picture; "" without points."""
    if len(points) < 2:
        return ""
    last_s = max(point.elapsed_s for point in points) or 1.0
    panels = [one for one in PANELS if any(name in point.values for point in points for name, _ in one[1])]
    height = len(panels) * PANEL + FOOT
    parts = [*_pauses(points, last_s, height - FOOT), *_times(last_s, height)]
    for number, (label, names) in enumerate(panels):
        parts += _panel(points, last_s, number * PANEL, say(Cause(label), language), names)
    title = escape(say(Cause("curve_title"), language))
    return (
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{title}" font-family="system-ui, sans-serif" '
        f'font-size="15" fill="currentColor">\n' + "\n".join(parts) + "\n</svg>\n" + _legend(language)
    )


def _x(elapsed_s: float, last_s: float) -> float:
    return LEFT + (RIGHT - LEFT) * elapsed_s / last_s


def _pauses(points: Sequence[Point], last_s: float, bottom: int) -> Iterator[str]:
    """Grey where the charger was not told to run."""
    since_s: float | None = None
    for point in points:
        runs = point.state in ENERGISED_NAMES
        if not runs and since_s is None:
            since_s = point.elapsed_s
        if runs and since_s is not None:
            yield _grey(since_s, point.elapsed_s, last_s, bottom)
            since_s = None
    if since_s is not None:
        yield _grey(since_s, last_s, last_s, bottom)


def _grey(from_s: float, to_s: float, last_s: float, bottom: int) -> str:
    left, width = _x(from_s, last_s), max(_x(to_s, last_s) - _x(from_s, last_s), 1.0)
    return f'<rect x="{left:.1f}" y="0" width="{width:.1f}" height="{bottom}" fill="#888" opacity=".18"/>'


def _times(last_s: float, height: int) -> Iterator[str]:
    every_min = next((one for one in EVERY_MIN if last_s / 60 / one <= MARKS), EVERY_MIN[-1])
    for number in range(int(last_s / 60 / every_min) + 1):
        x, minutes = _x(number * every_min * 60, last_s), number * every_min
        yield f'<line x1="{x:.1f}" y1="0" x2="{x:.1f}" y2="{height - FOOT}" stroke="#888" opacity=".3"/>'
        yield f'<text x="{x:.1f}" y="{height - 7}" text-anchor="middle">{minutes // 60}:{minutes % 60:02}</text>'


def _panel(
    points: Sequence[Point], last_s: float, top: int, label: str, names: Sequence[tuple[str, str]]
) -> Iterator[str]:
    """One panel: its label, its scale, its lines."""
    values = [point.values[name] for point in points for name, _ in names if name in point.values]
    low, high = min(values), max(values)
    middle, half = (low + high) / 2, max((high - low) / 2, 0.5)
    upper, lower = top + TOP, top + PANEL - 8

    def y(value: float) -> float:
        return (upper + lower) / 2 - (value - middle) / half * (lower - upper) / 2

    yield f'<text x="{LEFT}" y="{top + 17}" font-weight="600">{escape(label)}</text>'
    for value in dict.fromkeys((low, high)):
        yield f'<text x="{LEFT - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.1f}</text>'
        yield f'<line x1="{LEFT}" y1="{y(value):.1f}" x2="{RIGHT}" y2="{y(value):.1f}" stroke="#888" opacity=".3"/>'
    for name, colour in reversed(names):
        for line in _lines([(point.elapsed_s, point.values.get(name)) for point in points]):
            drawn = " ".join(f"{_x(at_s, last_s):.1f},{y(value):.1f}" for at_s, value in _thin(line))
            yield f'<polyline points="{drawn}" fill="none" stroke="{colour}" stroke-width="1.6"/>'


def _lines(values: Sequence[tuple[float, float | None]]) -> Iterator[Line]:
    """The pieces between which nothing was known for long."""
    now: Line = []
    for at_s, value in values:
        if now and (value is None or at_s - now[-1][0] > GAP_S):
            yield now
            now = []
        if value is not None:
            now.append((at_s, value))
    if now:
        yield now


def _thin(line: Line) -> Iterator[tuple[float, float]]:
    every = -(-2 * len(line) // MOST)
    if every <= 2:
        yield from line
        return
    for at in range(0, len(line), every):
        some = line[at : at + every]
        yield from sorted({min(some, key=lambda one: one[1]), max(some, key=lambda one: one[1])})


def _legend(language: str) -> str:
    words = (("curve_battery", BATTERY), ("curve_charger", CHARGER))
    marks = [
        f'<span style="color:{colour}">&#9632;</span> {escape(say(Cause(id_), language))}' for id_, colour in words
    ]
    grey = f'<span style="color:#888">&#9632;</span> {escape(say(Cause("curve_pause"), language))}'
    return f"<p>{' &#160; '.join((*marks, grey))}</p>\n"
