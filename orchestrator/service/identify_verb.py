"""`orchestrator identify BAY --battery ID`: an operator says which battery is in a bay."""

import argparse
import sys

from orchestrator.lastresort.asking import ask
from orchestrator.model import Cause
from orchestrator.model.cause import from_plain
from orchestrator.service.where import find_socket
from orchestrator.show import own_language
from orchestrator.text.catalogue import say
from orchestrator.text.document import language_of_answer, refusals


def identify(arguments: argparse.Namespace) -> int:
    """Ask, and say which battery it is now, and by which source; 1 if it was refused."""
    request = {"verb": "identify", "bays": [arguments.bay], "battery": arguments.battery}
    answer = ask(find_socket(arguments.socket), request)
    language = language_of_answer(answer, own_language())
    refusal = refusals(answer, language)[arguments.bay]
    if refusal:
        print(say(Cause.of("bay_refused", bay=arguments.bay, why=refusal), language), file=sys.stderr)
        return 1
    identity = from_plain(answer["identity"])
    print(say(Cause.of("identity_now", bay=arguments.bay, what=identity), language))
    return 0
