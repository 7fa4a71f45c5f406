"""Scripts that complete the command line in a shell, from its parser."""

import argparse

from orchestrator.shell.commands import actions_of, verbs_of

SHELLS = ("bash", "zsh", "fish")
#: The arguments that are files, and those that are names of bays, which the running service knows.
FILES = frozenset({"station", "file", "policy", "journal", "scenario", "out", "socket", "port"})
BAYS = frozenset({"bay", "excepted"})
#: What `completion` takes besides: the names of the bays, one a line, for the scripts.
NAMES = "bays"


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script for this shell. ImportError without the extra."""
    import shtab  # noqa: PLC0415 - an extra

    for verb in verbs_of(parser).values():
        for action in actions_of(verb):
            if action.dest in FILES:
                action.complete = shtab.FILE  # type: ignore[attr-defined]  # that is how shtab is told
            elif action.dest in BAYS:
                action.complete = shtab.cmd(f"orchestrator completion {NAMES} 2>/dev/null")  # type: ignore[attr-defined]  # as above
    return str(shtab.complete(parser, shell))
