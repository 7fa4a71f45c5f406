"""The manual page, in roff, from the parser of the command line. Pure."""

import argparse
import re
from collections.abc import Iterator

from orchestrator import __version__
from orchestrator.shell.commands import abouts_of, actions_of, explained, verbs_of
from orchestrator.shell.examples import EXAMPLES

EXIT = (
    ("0", "It worked."),
    ("1", "The answer is no: something was refused, is wrong, or could not be verified."),
    ("2", "There is no answer: the command line is wrong, or no service answers."),
)
ENVIRONMENT = (
    ("ORCHESTRATOR_SOCKET", "The service's control socket, unless --socket names one."),
    ("LC_ALL, LC_MESSAGES, LANG", "The language of what is printed: English, or Korean for ko."),
    ("SUDO_USER", "The person for whom root acts; it stands beside root in the journal."),
)
FILES = (
    ("station.yaml", "The station file that is used in this folder if none is named."),
    ("/etc/orchestrator/station.yaml", "The installed service's station file."),
    ("/run/orchestrator/orchestrator.sock", "The installed service's control socket."),
)


def manpage(parser: argparse.ArgumentParser) -> str:
    """The page `orchestrator(1)`."""
    return "\n".join(_lines(parser)) + "\n"


def _lines(parser: argparse.ArgumentParser) -> Iterator[str]:
    yield f'.TH ORCHESTRATOR 1 "" "orchestrator {__version__}" "User Commands"'
    yield from (".SH NAME", "orchestrator \\- supervise battery charging bays")
    yield from (".SH SYNOPSIS", ".B orchestrator", ".I VERB", "[\\fIARGUMENT\\fR ...]")
    yield from (".SH DESCRIPTION", _roff(parser.description or ""))
    abouts = dict(abouts_of(parser))
    yield ".SH VERBS"
    for name, verb in verbs_of(parser).items():
        yield from _verb(name, verb, abouts.get(name, ""))
    for title, rows in (("EXIT STATUS", EXIT), ("ENVIRONMENT", ENVIRONMENT), ("FILES", FILES)):
        yield f".SH {title}"
        for term, about in rows:
            yield from _term(f"\\fB{_roff(term)}\\fR", about)


def _verb(name: str, verb: argparse.ArgumentParser, about: str) -> Iterator[str]:
    usage = re.sub(r"\s+", " ", verb.format_usage()).removeprefix("usage: ").strip()
    yield f".SS {name}"
    yield _roff(f"{about[:1].upper()}{about[1:]}.")
    yield from (".PP", f"\\fB{_roff(usage)}\\fR")
    for action in actions_of(verb):
        if action.help is not argparse.SUPPRESS and "--help" not in action.option_strings:
            yield from _term(_name(action), explained(action, verb.prog))
    for command, what in EXAMPLES.get(name, ()):
        yield from (".PP", f"Example: {_roff(what)}:", ".RS", ".nf", _roff(f"orchestrator {command}"), ".fi", ".RE")


def _name(action: argparse.Action) -> str:
    """How an argument is written: "--socket PATH"."""
    shown = action.metavar or ("|".join(map(str, action.choices)) if action.choices else action.dest.upper())
    value = f"\\fI{_roff(str(shown))}\\fR"
    if not action.option_strings:
        return value
    names = ", ".join(f"\\fB{_roff(one)}\\fR" for one in action.option_strings)
    return names if action.nargs == 0 else f"{names} {value}"


def _term(term: str, about: str) -> Iterator[str]:
    yield from (".TP", term, _roff(about))


def _roff(text: str) -> str:
    """Text in which nothing is a command of roff."""
    plain = text.replace("\\", "\\e").replace("-", "\\-").replace("…", "...")
    return f"\\&{plain}" if plain.startswith((".", "'")) else plain
