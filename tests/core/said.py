"""What the core says, read as a person reads it. What a template does not fit fails here, in each language."""

from orchestrator.model import Cause, Decision
from orchestrator.text.catalogue import LANGUAGES, _sentence


def say(cause: Cause | None) -> str:
    """In English; in the product a mistake is shown as data, here it is one."""
    if cause is None:
        return ""
    for texts in LANGUAGES.values():
        _sentence(cause, texts)
    return _sentence(cause, LANGUAGES["en"])


def reason_of(decision: Decision) -> str:
    """Why the bay is where it is."""
    return say(decision.cause)


def said(value: object) -> object:
    """A value with the causes in it, however deep, as their sentences."""
    if isinstance(value, Cause):
        return say(value)
    if isinstance(value, tuple | list):
        return type(value)(said(one) for one in value)
    return value


def cause(text: str, advice: str = "") -> Cause:
    """A cause that says just this."""
    return Cause.of("said", advice=advice, text=text)
