"""The verbs of a parser, and their arguments, for whoever writes pages and scripts from them."""

import argparse
from collections.abc import Iterator, Mapping

from orchestrator.shell.examples import epilog


def verbs_of(parser: argparse.ArgumentParser) -> Mapping[str, argparse.ArgumentParser]:
    """Each verb's own parser, in order."""
    return next(dict(one.choices) for one in actions_of(parser) if isinstance(one, argparse._SubParsersAction))  # noqa: SLF001 - argparse offers no other way


def actions_of(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """All that a parser takes."""
    return list(parser._actions)  # noqa: SLF001 - as above


def abouts_of(parser: argparse.ArgumentParser) -> Iterator[tuple[str, str]]:
    """Each verb with its line in the list of verbs."""
    for action in actions_of(parser):
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - as above
            yield from ((str(one.dest), one.help or "") for one in action._choices_actions)  # noqa: SLF001 - as above


def with_examples(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """The parser, each verb of which ends its help with examples."""
    for name, verb in verbs_of(parser).items():
        verb.epilog, verb.formatter_class = epilog(name), argparse.RawDescriptionHelpFormatter
    return parser


def explained(action: argparse.Action, prog: str) -> str:
    """An argument's help, with its default filled in as argparse does it."""
    known = {name: value for name, value in vars(action).items() if value is not argparse.SUPPRESS}
    return (action.help or "") % {**known, "prog": prog}
