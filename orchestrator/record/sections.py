"""What is said of charges, in sections, for a terminal and as a web page that needs nothing else. Pure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

from orchestrator.columns import aligned, folded
from orchestrator.model import Cause
from orchestrator.text.catalogue import say

Row = tuple[str, ...]
#: The language of a page whose reader has none.
DEFAULT = "en"

#: Readable on a phone, in the dark, and on paper.
STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 0 auto; padding: 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.3rem; } h2 { font-size: 1.05rem; margin: 1.5rem 0 .4rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
td, th { padding: .25rem 1rem .25rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid #8884; }
th { font-weight: 600; white-space: nowrap; } td { overflow-wrap: normal; min-width: 3rem; }
td:last-child { min-width: 7rem; }
svg { width: 100%; max-width: 46rem; height: auto; display: block; }
"""


@dataclass(frozen=True, slots=True)
class Section:
    """A table with a title; of one column: lines."""

    title: str
    rows: Sequence[Row]
    has_head: bool = False  #: the first row is one


def heads(id_: str, language: str) -> Row:
    """The heads of a table, which the catalogue has in one text."""
    return tuple(say(Cause(id_), language).split("|"))


def as_text(sections: Sequence[Section], width: int) -> str:
    """For a terminal of this width; empty sections are left out."""
    return "\n\n".join("\n".join(_lines(section, width)) for section in sections if section.rows)


def _lines(section: Section, width: int) -> Iterator[str]:
    if section.title:
        yield folded(section.title, width)
    if section.has_head:
        yield aligned(section.rows, width)
        return
    for row in section.rows:
        yield folded("  ".join(("", *row)) if section.title else "  ".join(row), width)


def as_page(title: str, language: str, sections: Sequence[Section], picture: str = "") -> str:
    """A web page in one file; `picture` is SVG and stands before the sections."""
    body = "\n".join(_html(section) for section in sections if section.rows)
    return (
        f'<!DOCTYPE html>\n<html lang="{escape(language) or DEFAULT}">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{escape(title)}</h1>\n{picture}{body}\n</body>\n</html>\n"
    )


def _html(section: Section) -> str:
    title = f"<h2>{escape(section.title)}</h2>\n" if section.title else ""
    if all(len(row) == 1 for row in section.rows):
        return title + "\n".join(f"<p>{escape(row[0])}</p>" for row in section.rows)
    rows = [_row(row, "th" if section.has_head and not number else "td") for number, row in enumerate(section.rows)]
    return f'{title}<div class="wide"><table>\n' + "\n".join(rows) + "\n</table></div>"


def _row(cells: Row, tag: str) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"
