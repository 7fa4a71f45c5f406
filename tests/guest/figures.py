"""The measurements in the guest as a table, printed at the end and left where the host finds it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Figure:
    """The event in mid-charge, when the charger got its stop, and when that was over (None: it is not).

    Over: it charges again, or, `held`, the service is back and waits for its operator with the charger verified.
    """

    what: str
    stop_s: float
    again_s: float | None = None
    held: bool = False

    @property
    def row(self) -> tuple[str, str, str]:
        again = "–" if self.again_s is None else f"{self.again_s:.1f} s{' (held)' if self.held else ''}"
        return self.what, f"{self.stop_s * 1000:.0f} ms", again


FIGURES: list[Figure] = []
HEAD = ("what was done in mid-charge", "stop byte after", "charges again (held: may be started) after")


def table() -> Iterator[str]:
    """The lines of a Markdown table."""
    rows = [HEAD, *(figure.row for figure in FIGURES)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD))]
    for number, row in enumerate(rows):
        yield f"| {' | '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))} |"
        if number == 0:
            yield f"| {' | '.join('-' * width for width in widths)} |"


def write(folder: Path) -> None:
    (folder / "figures.md").write_text("\n".join(table()) + "\n", encoding="utf-8")
