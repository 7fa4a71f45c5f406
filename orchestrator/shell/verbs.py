"""The verbs for the shell around the command line: its completion, and its manual page."""

import argparse
from collections.abc import Callable
from typing import cast

from orchestrator.shell.completion import NAMES, SHELLS

MakeParser = Callable[[], argparse.ArgumentParser]


def add_shell_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", make: MakeParser) -> None:
    """`completion` and `manpage`, from the parser that `make` returns."""
    completion = verbs.add_parser("completion", help="print the script that completes this command line in a shell")
    completion.add_argument("shell", choices=(*SHELLS, NAMES), metavar="|".join(SHELLS), help="the shell")
    completion.set_defaults(run=lambda arguments: _completion(arguments, make))
    manual = verbs.add_parser("manpage", help="print the manual page, for man")
    manual.set_defaults(run=lambda _: _manpage(make))


def _completion(arguments: argparse.Namespace, make: MakeParser) -> int:
    from orchestrator.shell.completion import script
    from orchestrator.workbench.verbs import missing

    if arguments.shell == NAMES:
        return _names()
    try:
        print(script(make(), arguments.shell))
    except ImportError as error:
        raise missing("completion", error, "completion") from None
    return 0


def _names() -> int:
    """The names of the bays, for the scripts."""
    from orchestrator.lastresort.asking import ask
    from orchestrator.service.where import find_socket

    for bay in cast("list[dict[str, object]]", ask(find_socket(None), {"verb": "status"})["bays"]):
        print(bay["name"])
    return 0


def _manpage(make: MakeParser) -> int:
    from orchestrator.shell.manpage import manpage

    print(manpage(make()), end="")
    return 0
