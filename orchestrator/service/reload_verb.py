"""`orchestrator reload`: have the service reread its policies, and show what came of it for every bay."""

import argparse
import sys
from collections.abc import Mapping
from typing import cast

from orchestrator.lastresort.asking import ask
from orchestrator.lastresort.signing import signed
from orchestrator.model import Cause
from orchestrator.service.where import find_socket
from orchestrator.show import own_language
from orchestrator.text.catalogue import say
from orchestrator.text.document import language_of_answer, refusals, said

#: Reading the files of a large station from a slow disk takes a while.
ANSWER_S = 12.0


def reload(arguments: argparse.Namespace) -> int:
    """Ask, and show each bay's answer; 1 if anything was refused."""
    request = signed({"verb": "reload"}, arguments.because)
    answer = ask(find_socket(arguments.socket), request, ANSWER_S)
    language = language_of_answer(answer, own_language())
    refused = {name: why for name, why in refusals(answer, language).items() if why}
    notes, causes = (cast("Mapping[str, str]", answer.get(name, {})) for name in ("notes", "note_causes"))
    for name, note in notes.items():
        if name not in refused:
            print(_line(name, said(causes.get(name), note, language), language))
    sys.stdout.flush()
    for name, why in refused.items():
        print(_line(name, why, language), file=sys.stderr)
    return 1 if refused else 0


def _line(name: str, what: str, language: str) -> str:
    return say(Cause.of("reload", bay=name, what=what), language)
