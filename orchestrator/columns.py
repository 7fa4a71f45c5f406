"""Text for a terminal: its width and letters, how a long line is folded, and tables that fit."""

import json
import os
import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from unicodedata import east_asian_width

#: Never split at the end of a line: a command that somebody may copy, a figure and its unit, a word.
WORD = re.compile(r"orchestrator \S+ \S+|\d\S* (?:°C|Ah|Wh|V|A|%|s|min|h|K)\S*|\S+")

#: Where a cell may be folded: between words, and inside a key or a path; a figure keeps its unit.
PART = re.compile(r"(?:\d[\d.:]* \S+|[(./]*(?:[^\s./]|\.(?=ya?ml))+[./]*|\S)\s*")
#: Behind these a path is cut, where it must be.
BREAKS = "/-:"
#: A cell is folded to this, a heading also to the width of what stands below it.
MOST_CELL, MOST_HEADING = 24, 12
#: Between two columns.
GAP = 2


def own_width() -> int:
    """How many columns the terminal has; 0 where it is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else 0


def own_height() -> int:
    """How many lines the terminal can redraw in place; 0 where it is none, or cannot move its cursor."""
    return shutil.get_terminal_size().lines if _is_able() else 0


def own_colour() -> bool:
    """Whether to use colour: not in a file or a pipe, and not where somebody does not want it (no-color.org)."""
    return _is_able() and not os.environ.get("NO_COLOR")


def json_text(value: object, indent: int | None = None) -> str:
    """JSON in letters that the output can show: it must stay what it is, whatever the encoding."""
    utf_8 = (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"
    return json.dumps(value, ensure_ascii=not utf_8, indent=indent)


def _is_able() -> bool:
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


def width_of(text: str) -> int:
    """The number of terminal columns it takes: a Korean letter takes two."""
    return sum(2 if east_asian_width(one) in "WF" else 1 for one in text)


def cut(line: str, width: int) -> Iterator[str]:
    """The line in pieces of at most this width (0: unlimited): the last resort for a word longer than the screen."""
    if not width or width_of(line) <= width:
        yield line
        return
    now = ""
    for one in line:
        if now and width_of(now + one) > width:
            at = max(now.rfind(sign) + 1 for sign in BREAKS)
            at = at if at > len(now) // 2 else len(now)
            yield now[:at]
            now = now[at:]
        now += one
    yield now


def folded(line: str, width: int, head: str = "") -> str:
    """The line behind its head, folded to this width (0: not folded).

    Text with a head stays in its column; without one, every line but the first is indented.
    """
    if not width or width_of(head + line) <= width:
        return head + line
    indent = width_of(head) or 4
    lines, now = [], head or " " * (len(line) - len(line.lstrip()))
    for word in WORD.findall(line):
        if now[len(head) :].strip() and width_of(now) + width_of(word) > width:
            lines.append(now.rstrip())
            now, head = " " * indent, ""
        now += f"{word} "
    return "\n".join([*lines, now.rstrip()])


def beside(cells: Sequence[str], widths: Sequence[int], width: int = 0) -> str:
    """The cells in columns of these widths; columns beyond `width` (0: unlimited) continue on indented lines.

    They move together where all of them fit only then.
    """
    lines, now = [], ""
    gap = 1 if sum(widths) + GAP * (len(widths) - 1) > width >= sum(widths) + len(widths) - 1 else GAP
    for cell, columns in zip(cells, widths, strict=True):
        if width and now.strip() and width_of(now) + columns > width:
            lines.append(now.rstrip())
            now = " " * 4
        now += cell + " " * (columns - width_of(cell) + gap)
    return "\n".join([*lines, now])


def aligned(rows: Sequence[Sequence[str]], width: int = 0, keys: int = 1) -> str:
    """A table, with headings in its first row.

    If it is wider than `width` (0: unlimited), cells are folded, and columns without room follow in further blocks,
    which repeat the first `keys` columns.
    """
    cells, widths = [[[cell] for cell in row] for row in rows], _widths(rows)
    if not width or sum(widths) + GAP * (len(widths) - 1) <= width:
        return _block(cells, widths, range(len(widths)))
    body = [min(columns, MOST_CELL) for columns in _widths(rows[1:])]
    most = [[max(columns, MOST_HEADING) for columns in body], *([MOST_CELL] * len(body) for _ in rows[1:])]
    cells = [[list(_parts(*cell)) for cell in zip(row, m, strict=True)] for row, m in zip(rows, most, strict=True)]
    widths = [max(width_of(line) for cell in column for line in cell) for column in zip(*cells, strict=True)]
    return "\n\n".join(_block(cells, widths, columns) for columns in _blocks(widths, width, keys))


def _widths(rows: Sequence[Sequence[str]]) -> list[int]:
    return [max(map(width_of, column)) for column in zip(*rows, strict=True)]


def _parts(cell: str, most: int) -> Iterator[str]:
    """The cell in lines of at most this width, as far as it can be folded."""
    now = ""
    for part in PART.findall(cell):
        if now and width_of(now) + width_of(part.rstrip()) > most:
            yield now.rstrip()
            now = ""
        now += part
    yield now.rstrip()


def _blocks(widths: Sequence[int], width: int, keys: int) -> Iterator[list[int]]:
    """The columns of each block, as numbers."""
    first = list(range(keys))
    now = [*first]
    for column in range(keys, len(widths)):
        if len(now) > keys and sum(widths[one] + GAP for one in now) + widths[column] > width:
            yield now
            now = [*first]
        now.append(column)
    yield now


def _block(cells: Sequence[Sequence[Sequence[str]]], widths: Sequence[int], columns: Sequence[int]) -> str:
    """These columns of a table whose cells may have several lines."""
    lines = (line for row in cells for line in zip_longest(*(row[one] for one in columns), fillvalue=""))
    return "\n".join(beside(line, [widths[one] for one in columns]).rstrip() for line in lines)
