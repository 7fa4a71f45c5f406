"""The demo on a terminal: a live picture with rich, or line by line if there is no terminal."""

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Protocol, cast

from orchestrator.demo.story import Story
from orchestrator.show import figure, step_of

if TYPE_CHECKING:
    from rich.panel import Panel

#: The number of events that fit in the picture.
ROOM = 12
#: Colours of special events: a state that ended a charge, or that needs a person.
STYLES = {
    "STOPPING": "yellow",
    "HELD": "bold yellow",
    "TRIPPED": "bold red",
    "UNCONTROLLABLE": "bold red",
    "FULL": "bold green",
}
#: Without a terminal, print a line of figures this often.
LINE_EVERY_S = 2.0


class Screen(Protocol):
    """A display for the demo."""

    def live(self) -> AbstractContextManager[object]:
        """The context in which `show` draws."""

    def show(self, t_s: float, bay: Mapping[str, object], story: Story) -> None:
        """Draw the present state."""


def figures(bay: Mapping[str, object]) -> tuple[tuple[str, str], ...]:
    """A bay's main figures, by name."""
    battery = cast("Mapping[str, object]", bay["battery"])
    charger = cast("Mapping[str, object]", bay["charger"])
    step = step_of(bay["step"], bay["step_current_a"])
    return (
        ("state", str(bay["state"])),
        ("SOC", figure(battery["soc_pct"], "{:.0f} %")),
        ("pack", figure(battery["voltage_v"], "{:.2f} V")),
        ("current", figure(charger["current_a"], "{:.2f} A")),
        ("temperature", figure(battery["temperature_c"], "{:.1f} °C")),
        ("step", step),
    )


class Lines:
    """One line per event, and figures in between."""

    def __init__(self) -> None:
        self._told = 0
        self._line_s = 0.0

    def live(self) -> AbstractContextManager[object]:
        """Lines need no preparation."""
        return nullcontext()

    def show(self, t_s: float, bay: Mapping[str, object], story: Story) -> None:
        """Print what is new."""
        for at_s, what, why in story.events[self._told :]:
            print(f"{at_s:6.1f} s  {what}: {why}", flush=True)
        self._told = len(story.events)
        if t_s - self._line_s >= LINE_EVERY_S:
            self._line_s = t_s
            print(f"{t_s:6.1f} s  " + "  ".join(f"{name} {value}" for name, value in figures(bay)), flush=True)


class Picture:
    """The whole demo at a glance, redrawn in place."""

    def __init__(self) -> None:
        from rich.live import Live  # an extra; `Lines` works without it

        self._live = Live(auto_refresh=False)

    def live(self) -> AbstractContextManager[object]:
        """Draw in place from now on."""
        return self._live

    def show(self, t_s: float, bay: Mapping[str, object], story: Story) -> None:
        """Redraw."""
        self._live.update(picture(t_s, bay, story), refresh=True)


def picture(t_s: float, bay: Mapping[str, object], story: Story) -> "Panel":
    """One moment of the demo: figures, charge, reason, and the events so far."""
    from rich.console import Group
    from rich.panel import Panel
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    values = Table.grid(padding=(0, 3))
    values.add_row(*(Text(name, style="dim") for name, _ in figures(bay)))
    values.add_row(*(Text(value, style="bold") for _, value in figures(bay)))
    battery = cast("Mapping[str, object]", bay["battery"])
    soc = battery["soc_pct"]
    bar = ProgressBar(total=100, completed=float(soc) if isinstance(soc, int | float) else 0.0, width=60)
    past = Table.grid(padding=(0, 2))
    for at_s, what, why in story.events[-ROOM:]:
        past.add_row(Text(f"{at_s:5.1f} s", style="dim"), Text(what, style=_style(what)), Text(why))
    title = f"charging-station orchestrator: demo, {t_s:.0f} s"
    return Panel(Group(values, bar, Text(), Text(str(bay["reason"])), Text(), past), title=title)


def _style(what: str) -> str:
    if what.startswith("inject"):
        return "bold magenta"
    return STYLES.get(what, "cyan")
