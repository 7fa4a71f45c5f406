"""`orchestrator status`: once, or again and again."""

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import cast

from orchestrator.columns import json_text, own_colour, own_width
from orchestrator.errors import NoServiceError, ServiceError, UsageError
from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.model.cause import plain
from orchestrator.page import Block, blocks, needs_a_person, painted
from orchestrator.service.chosen import choose, is_plain, unknown
from orchestrator.service.where import find_socket
from orchestrator.show import level_of, own_language
from orchestrator.text.catalogue import say
from orchestrator.text.document import language_of_answer

#: How long to wait for an answer.
ANSWER_S = 5.0
#: The time of day on the reader's clock.
CLOCK = "%H:%M:%S"


def status(arguments: argparse.Namespace) -> int:
    """Show the status; with `--check`, return 1 if something needs a person."""
    from orchestrator.service.watch import watch

    if arguments.check and arguments.watch:
        raise UsageError("status: --check looks once and --watch does not end: use one of them")
    path = find_socket(arguments.socket)
    if arguments.watch:
        watch(path, arguments)
    document = _checked(path, arguments) if arguments.check else look(path, arguments)
    if arguments.json:
        print(json_text(document), flush=True)
    else:
        print(painted(_blocks(document, arguments), colour=own_colour()), flush=True)
    return int(arguments.check and needs_a_person(document))


def _blocks(document: dict[str, object], arguments: argparse.Namespace) -> list[Block]:
    """A page about the one bay that is named, else the table of all that are meant."""
    language, width = own_language(), own_width()
    if named(arguments) is None or arguments.problems or arguments.group:
        return overview(document, arguments, time.strftime(CLOCK))
    from orchestrator.service.bay_page import bay_blocks
    from orchestrator.service.history_verb import last_events

    bay, now_s = arguments.bay[0], time.time()
    directory = cast("dict[str, str]", document.get("journal", {})).get("directory")
    told_in = language_of_answer(document, language)
    events = last_events(Path(directory), bay, told_in, now_s) if directory else []
    return bay_blocks(document, events, language, width, now_s)


def overview(document: Mapping[str, object], arguments: argparse.Namespace, clock: str) -> list[Block]:
    """The bays in groups, or in a table."""
    language, width = own_language(), own_width()
    if arguments.group:
        from orchestrator.service.group_page import group_blocks

        return group_blocks(document, language, width, clock, problems=arguments.problems)
    return blocks(document, language, width, clock, problems=arguments.problems)


def named(arguments: argparse.Namespace) -> str | None:
    """The bay, if exactly one is named, and not by a pattern."""
    words = arguments.bay
    return words[0] if len(words) == 1 and is_plain(words) and not arguments.excepted else None


def _checked(path: Path, arguments: argparse.Namespace) -> dict[str, object]:
    """The same, where an answer of no is none, too: an unknown bay must not look like one that needs a person."""
    try:
        return look(path, arguments)
    except ServiceError as error:
        raise NoServiceError(str(error), error.told) from None


def look(path: Path, arguments: argparse.Namespace, within_s: float = ANSWER_S) -> dict[str, object]:
    """The status document with the bays that the command line means. ServiceError if one of them is unknown."""
    document = ask(path, {"verb": "status", "bay": named(arguments)}, within_s)
    document.pop("ok")
    return meant(document, arguments)


def meant(document: dict[str, object], arguments: argparse.Namespace) -> dict[str, object]:
    """This document with the bays that the command line means. ServiceError if one of them is unknown."""
    words, excepted = arguments.bay, arguments.excepted
    bays = cast("list[dict[str, object]]", document["bays"])
    if words or excepted:
        known = [str(bay["name"]) for bay in bays]
        chosen = choose(words or None, excepted, known)
        if chosen.unknown or not chosen.bays:
            cause = unknown(chosen.unknown, known) if chosen.unknown else Cause("no_bay_left")
            raise ServiceError(say(cause, language_of_answer(document, own_language())), plain(cause))
        bays = [bay for bay in bays if bay["name"] in chosen.bays]
    if arguments.problems and arguments.json:
        bays = [bay for bay in bays if level_of(bay)]
    return {**document, "bays": bays}
