"""The bays of a station in groups by what they do: 64 of them fit into a window of 80 × 30."""

from collections.abc import Iterator, Mapping, Sequence
from typing import cast

from orchestrator.columns import GAP, beside, folded, width_of
from orchestrator.gist import COUNTED, NEEDS, ORDER, OTHER, counted, gist
from orchestrator.model import Cause
from orchestrator.page import INDENT, LEAST_WHY, SIGNS, Block, all_cut, loud
from orchestrator.show import Bay, figure, is_alarming, level_of, urgency
from orchestrator.text.catalogue import say
from orchestrator.text.document import in_language, language_of_answer

#: Lines of a file are not longer, nor those of a wide terminal: rows of names beyond are hard to read.
WIDTH = 80
#: What this many bays need is told in words, each in a line; of more there are the names alone.
IN_WORDS = 6
#: So many alarms are told at length; of the others there is the number.
ALARMS = 2
MORE = "…"


def group_blocks(
    document: Mapping[str, object], language: str, width: int, clock: str, *, problems: bool = False
) -> list[Block]:
    """The head line, what to do now, and a block for each group; with `problems` only what needs a person."""
    language = language_of_answer(document, language)
    document = in_language(document, language)
    bays = sorted(cast("Sequence[Bay]", document["bays"]), key=urgency)
    loudest = [bay for bay in bays if is_alarming(bay)]
    found = [Block(folded(say(gist(bays, clock), language), width)), *loud(document, loudest[:ALARMS], language, width)]
    if len(loudest) > ALARMS:
        found.append(Block(say(counted("count_more", len(loudest) - ALARMS), language), "danger"))
    groups: dict[str, list[Bay]] = {}
    for bay in bays:
        groups.setdefault(NEEDS if level_of(bay) else COUNTED.get(str(bay["state"]), OTHER), []).append(bay)
    shown = [id_ for id_ in (NEEDS, *(one for one in ORDER if one != NEEDS)) if id_ in groups]
    if problems:
        shown = [id_ for id_ in shown if id_ == NEEDS]
    headings = {id_: say(counted(id_, len(groups[id_])), language) for id_ in shown}
    margin = max(map(width_of, headings.values()), default=0) + GAP
    found += (_group(headings[id_], groups[id_], min(width or WIDTH, WIDTH), margin) for id_ in shown)
    if not shown:
        found.append(Block(say(Cause("no_problems"), language)))
    return all_cut(found, width)


def _group(heading: str, bays: Sequence[Bay], width: int, margin: int) -> Block:
    """Its heading with rows of names beside or below it; what few bays need is told in words."""
    told = [bay for bay in bays if level_of(bay) and not is_alarming(bay)]
    told = told if len(told) <= IN_WORDS and width >= LEAST_WHY else []
    named = [bay for bay in bays if bay not in told]
    wide = width - margin >= LEAST_WHY
    indent = " " * margin if wide else INDENT
    lines = [indent + row for row in _rows(named, width - width_of(indent))]
    if lines and wide:
        lines[0] = heading + " " * (margin - width_of(heading)) + lines[0].lstrip()
    else:
        lines.insert(0, heading)
    return Block("\n".join([*lines, *(_in_words(bay, width) for bay in told)]), level_of(bays[0]), len(bays))


def _in_words(bay: Bay, width: int) -> str:
    """What a bay needs, as far as there is room: its page has all of it."""
    text = f"{SIGNS.get(level_of(bay), INDENT)}{bay['name']}  {bay['state']}  {bay['reason']}"
    while width_of(text) > width:
        text = text.removesuffix(MORE)[:-1].rstrip() + MORE
    return text


def _rows(bays: Sequence[Bay], width: int) -> Iterator[str]:
    """Names with their SOC, as many in a row as fit."""
    cells = [_cell(bay) for bay in bays]
    column = max(map(width_of, cells), default=0)
    in_row = max((width + GAP) // (column + GAP), 1)
    for at in range(0, len(cells), in_row):
        row = cells[at : at + in_row]
        yield beside(row, [column] * len(row)).rstrip()


def _cell(bay: Bay) -> str:
    soc = figure(cast("Mapping[str, object]", bay["battery"]).get("soc_pct"), "{:.0f} %")
    return f"{SIGNS.get(level_of(bay), '').strip()}{bay['name']} {soc}"
