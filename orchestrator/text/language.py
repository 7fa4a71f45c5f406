"""The reader's language, from the environment of a terminal, as POSIX defines it."""

from collections.abc import Mapping

from orchestrator.text.catalogue import LANGUAGES

#: The variables that set it, in order of precedence.
VARIABLES = ("LC_ALL", "LC_MESSAGES", "LANG")


def language_of(environment: Mapping[str, str]) -> str:
    """`ko` for "ko_KR.UTF-8"; English for "C" and for languages without texts; "" if no variable is set."""
    name = next(filter(None, map(environment.get, VARIABLES)), "")
    found = name.partition("_")[0].partition(".")[0].lower()
    return found if found in LANGUAGES or not found else "en"
