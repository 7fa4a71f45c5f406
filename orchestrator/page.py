"""The status document as lines for a terminal: the gist, what to do, then the bays, those that need a person first.

Lines come in blocks, each of one bay or one warning, so that a screen too small for all can leave out whole ones.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from orchestrator.columns import beside, cut, folded, width_of
from orchestrator.gist import counted, gist
from orchestrator.model import Cause
from orchestrator.show import Bay, below, head, is_alarming, labelled, level_of, row, strays, urgency, what_to_do
from orchestrator.text.catalogue import say
from orchestrator.text.document import in_language, language_of_answer

#: The sign before what needs a person, by its level; where a table has one, its other lines are indented as far.
SIGNS = {"danger": "!! ", "attention": "!  "}
INDENT = "   "
#: A terminal's colours: bold red and yellow.
COLOURS = {"danger": "\x1b[1;31m", "attention": "\x1b[33m"}
PLAIN = "\x1b[0m"
#: In a narrower column nobody reads why: it goes below its bay.
LEAST_WHY = 40


@dataclass(frozen=True, slots=True)
class Block:
    """Lines that belong together."""

    text: str
    level: str = ""  #: "danger", "attention", or "" if it needs nobody
    bays: int = 0  #: how many bays it shows


def page(document: Mapping[str, object], language: str = "", width: int = 0, clock: str = "") -> str:
    """The whole status, without colour."""
    return painted(blocks(document, language, width, clock), colour=False)


def blocks(
    document: Mapping[str, object], language: str = "", width: int = 0, clock: str = "", *, problems: bool = False
) -> list[Block]:
    """The whole status: the gist with the time of day, what to do, and the bays; or only those with `problems`.

    Lines are folded to `width` columns; 0 leaves each as long as it is.
    """
    language = language_of_answer(document, language)
    document = in_language(document, language)
    bays = sorted(cast("Sequence[Bay]", document["bays"]), key=urgency)
    shown = [bay for bay in bays if level_of(bay)] if problems else bays
    found = [*([Block(folded(say(gist(bays, clock), language), width))] if bays and clock else [])]
    found += loud(document, shown, language, width)
    found += _table(shown, language, width) if shown or not problems else [Block(say(Cause("no_problems"), language))]
    if not problems:
        found += [Block(folded(text, width)) for text in promised(document)]
    return all_cut(found, width)


def promised(document: Mapping[str, object]) -> list[str]:
    """What each supply has promised, if bays share any."""
    return [str(supply["text"]) for supply in cast("Sequence[Mapping[str, object]]", document.get("supplies", ()))]


def loud(document: Mapping[str, object], bays: Sequence[Bay], language: str, width: int) -> Iterator[Block]:
    """What to do now: about chargers that may be out of control, and about the station itself."""
    for text in (*strays(document, language), *(what_to_do(bay, language) for bay in bays if is_alarming(bay))):
        yield Block(folded(labelled("alarm", text, language), width), "danger")
    for text in warnings(document):
        yield Block(folded(labelled("warning", text, language), width), "attention")


def all_cut(found: Sequence[Block], width: int) -> list[Block]:
    """The blocks without a line wider than this (0: unlimited)."""
    return [Block(_cut(block.text, width), block.level, block.bays) for block in found]


def warnings(document: Mapping[str, object]) -> list[str]:
    """What is wrong with the station itself."""
    parts = (cast("Mapping[str, object]", document.get(part, {})).get("problem") for part in ("journal", "persisted"))
    return [str(problem) for problem in parts if problem]


def needs_a_person(document: Mapping[str, object]) -> bool:
    """Whether anything on this page is a problem: a bay, a charger without a bay, or the station itself."""
    bays = cast("Sequence[Bay]", document["bays"])
    return bool(any(map(level_of, bays)) or strays(document) or warnings(document))


def fitted(found: Sequence[Block], height: int, language: str = "") -> list[Block]:
    """As many blocks as fit into so many lines, and how many bays are left out."""
    if sum(map(_height, found)) <= height:
        return list(found)
    kept: list[Block] = []
    room, left = max(height, 1) - 1, sum(block.bays for block in found)
    for block in found:
        if _height(block) > room:
            break
        kept.append(block)
        room -= _height(block)
        left -= block.bays
    while len(kept) > 1 and not kept[-1].bays and not kept[-1].level:  # a table's head without a table
        kept.pop()
    if not kept and found:  # not even the first: as much of it as there is room for
        kept = [Block("\n".join(found[0].text.split("\n")[:room]), found[0].level)] if room else []
    return [*kept, Block(say(counted("count_more", left), language))] if left else kept


def painted(found: Sequence[Block], *, colour: bool) -> str:
    """The text of these blocks, with or without colour for what needs a person."""
    if not colour:
        return "\n".join(block.text for block in found)
    lines = ((line, COLOURS.get(block.level)) for block in found for line in block.text.split("\n"))
    return "\n".join(f"{begin}{line}{PLAIN}" if begin else line for line, begin in lines)


def _table(bays: Sequence[Bay], language: str, width: int) -> Iterator[Block]:
    """All bays, aligned; below each its further details."""
    marked = any(map(level_of, bays))
    inner = max(width - marked * len(INDENT), 1) if width else 0
    rows = [head(language), *(row(bay, language) for bay in bays)]
    widths = [max(width_of(cells[column]) for cells in rows) for column in range(len(rows[0]) - 1)]
    for cells, bay in zip(rows, [None, *bays], strict=True):
        fixed, why = beside(cells[:-1], widths, inner), cells[-1]
        narrow = inner and inner - width_of(fixed) < LEAST_WHY
        lines = [fixed.rstrip() if narrow else folded(why, inner, fixed).rstrip()]
        if bay is not None:
            details = [why, *below(bay, language)] if narrow else below(bay, language)
            lines.extend(folded(f"  {line}", inner) for line in details)
        level = level_of(bay) if bay is not None else ""
        yield Block(_marked("\n".join(lines), level) if marked else "\n".join(lines), level, int(bay is not None))


def _marked(text: str, level: str) -> str:
    first, *more = text.split("\n")
    return "\n".join([SIGNS.get(level, INDENT) + first, *(INDENT + line for line in more)])


def _cut(text: str, width: int) -> str:
    return "\n".join(part for line in text.split("\n") for part in cut(line, width))


def _height(block: Block) -> int:
    return block.text.count("\n") + 1
