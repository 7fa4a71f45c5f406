"""One self-contained HTML page for one or more simulations: it needs no network, and opens from an e-mail."""

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader

from orchestrator.workbench.draw.plot import colour, says, svg, when
from orchestrator.workbench.simulate.figures import compared, titles
from orchestrator.workbench.simulate.simulation import Run
from orchestrator.workbench.simulate.trail import Moment, bounds, clock_s

#: Moments kept per policy for the values shown under the pointer.
MAX_MOMENTS = 1500


def save_page(runs: Sequence[Run], path: Path) -> None:
    """Write the page."""
    environment = Environment(
        loader=PackageLoader("orchestrator.workbench.draw", "."), autoescape=True, trim_blocks=True
    )
    drawing, (head, *rows) = svg(runs), compared(runs)
    path.write_text(
        environment.get_template("page.html").render(
            scenario=runs[0].scenario,
            drawing=drawing,
            head=head,
            rows=[(row, len(set(row[1:])) > 1) for row in rows],
            policies=[
                _policy(run, title, number) for number, (run, title) in enumerate(zip(runs, titles(runs), strict=True))
            ],
            hours=runs[0].scenario.hours,
        ),
        encoding="utf-8",
    )


def _policy(run: Run, title: str, number: int) -> dict[str, object]:
    """The page's data about one policy."""
    moments = run.trail.moments
    every = -(-len(moments) // MAX_MOMENTS)
    return {
        "name": title,
        "file": run.policy.source.file,
        "colour": colour(number),
        "rules": [(bound.number, when(bound), says(bound.spans[0])) for bound in bounds(run.trail.spans)],
        "spans": [[span.from_s, f"{clock_s(span.from_s / 3600)}  {says(span)}"] for span in run.trail.spans],
        "moments": [_rounded(moment) for moment in moments[::every]],
    }


def _rounded(moment: Moment) -> list[float | None]:
    values = (moment.soc_pct, moment.voltage_v, moment.current_a, moment.temperature_c)
    return [moment.t_s, *(None if value is None else round(value, 2) for value in values)]
