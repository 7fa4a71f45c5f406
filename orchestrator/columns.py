"""Text for a terminal: its width, and how a long line is folded."""

import re
from unicodedata import east_asian_width

#: Never split at the end of a line: a command that somebody may copy, a figure and its unit, a word.
WORD = re.compile(r"orchestrator \S+ \S+|\d\S* (?:°C|Ah|Wh|V|A|%|s|min|h|K)\S*|\S+")


def width_of(text: str) -> int:
    """The number of terminal columns it takes: a Korean letter takes two."""
    return sum(2 if east_asian_width(one) in "WF" else 1 for one in text)


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
