"""Which language somebody reads: by the environment of a terminal, as POSIX has it."""

from collections.abc import Mapping

from orchestrator.text.catalogue import LANGUAGES

#: The variables that say so, the stronger ones first.
VARIABLES = ("LC_ALL", "LC_MESSAGES", "LANG")


def language_of(environment: Mapping[str, str]) -> str:
    """`ko` for "ko_KR.UTF-8"; English for "C" and for languages that there are no texts in; "" where nobody says."""
    name = next(filter(None, map(environment.get, VARIABLES)), "")
    found = name.partition("_")[0].partition(".")[0].lower()
    return found if found in LANGUAGES or not found else "en"
