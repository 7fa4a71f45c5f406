"""`orchestrator status --watch`: the status again and again, on a terminal in place and never longer than it.

The service tells what changes (`watch`). One that does not, because it is older or because many watch already, is asked
for its status again and again; so is any for what only an answer has: everything about one bay.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from orchestrator.columns import json_text, own_colour, own_height
from orchestrator.errors import NoServiceError, ServiceError
from orchestrator.model import Cause
from orchestrator.model.cause import said
from orchestrator.page import PLAIN, Block, fitted, painted
from orchestrator.service.followed import Followed, Refused
from orchestrator.service.status_verb import CLOCK, look, meant, named, overview
from orchestrator.show import own_language
from orchestrator.text.catalogue import say
from orchestrator.text.document import language_of_answer

#: The refresh interval, on a terminal after a change, and how long to wait for an answer before saying there is none.
WATCH_S, SOON_S, WITHIN_S = 1.0, 0.25, 3.0
#: Terminal codes: to the first line; clear this line; clear all below.
HOME, LINE, BELOW = "\x1b[H", "\x1b[K", "\x1b[J"


def watch(path: Path, arguments: argparse.Namespace) -> NoReturn:
    """Until Ctrl-C, or until nobody reads it. ServiceError if the service does not answer the first time."""
    view, source = _View(arguments), _Source(path, arguments)
    try:
        while True:
            try:
                document = source.look()
            except ServiceError as error:
                if not view.answered_at:  # one that has never answered may be the wrong one
                    raise
                view.show_lost(error)
            else:
                view.show(document)
            source.wait()
    except KeyboardInterrupt:
        view.leave()
        raise


class _Source:
    """Where the status comes from."""

    def __init__(self, path: Path, arguments: argparse.Namespace) -> None:
        self._path, self._arguments = path, arguments
        self._followed: Followed | None = None
        self._asks = arguments.json and named(arguments) is not None  # not followed

    def look(self) -> dict[str, object]:
        """The present status. ServiceError without an answer."""
        if self._followed is None and not self._asks:
            try:
                self._followed = Followed(self._path, WITHIN_S)
            except Refused:
                self._asks = True
            except (OSError, ValueError, LookupError):
                pass  # whoever is asked below says why
        if self._followed is not None:
            return meant(self._followed.document, self._arguments)
        return look(self._path, self._arguments, WITHIN_S)

    def wait(self) -> None:
        """Until it is time to look again."""
        if self._followed is None:
            time.sleep(WATCH_S)
            return
        try:
            self._followed.wait(SOON_S if own_height() else WATCH_S, WATCH_S)
        except (OSError, ValueError, LookupError):
            self._followed.close()
            self._followed = None


@dataclass(slots=True)
class _View:
    """What is on the screen."""

    arguments: argparse.Namespace
    answered_at: str = ""  #: the time of day of the last answer
    lost: bool = False
    _last: dict[str, object] = field(default_factory=dict)

    def show(self, document: dict[str, object]) -> None:
        """A new answer."""
        if self.lost and not own_height():
            self._note(Cause("answers_again"))
        self.answered_at, self.lost, self._last = time.strftime(CLOCK), False, document
        if self.arguments.json:
            print(json_text(document), flush=True)
        else:
            self._draw([])

    def show_lost(self, error: ServiceError) -> None:
        """No answer: the last one stays, below since when."""
        why = None if isinstance(error, NoServiceError) else said(str(error))
        cause = Cause.of("no_answer_since", last_at=self.answered_at, why=why)
        if own_height() and not self.arguments.json:
            self._draw([Block(f"{self._say(cause)} · {time.strftime(CLOCK)}", "danger")])
        elif not self.lost:
            self._note(cause)
        self.lost = True

    def leave(self) -> None:
        """Give the terminal back: the shell continues below."""
        if own_height() and not self.arguments.json:
            print(PLAIN if own_colour() else "", flush=True)

    def _draw(self, first: Sequence[Block]) -> None:
        """These blocks, and the last answer below them, at the time when it came."""
        language = language_of_answer(self._last, own_language())
        found, height = [*first, *overview(self._last, self.arguments, self.answered_at)], own_height()
        text = painted(fitted(found, height, language) if height else found, colour=own_colour())
        if not height:
            print(text, flush=True)
            return
        lines = text.split("\n")
        rest = f"\n{BELOW}" if len(lines) < height else ""  # cleared before it is written: the last column stays
        print(HOME + "\n".join(LINE + line for line in lines) + rest, end="", flush=True)

    def _note(self, cause: Cause) -> None:
        print(f"orchestrator: {self._say(cause)}", file=sys.stderr, flush=True)

    def _say(self, cause: Cause) -> str:
        return say(cause, language_of_answer(self._last, own_language()))
