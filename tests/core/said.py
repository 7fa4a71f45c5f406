"""The core's causes as a person reads them. A cause that does not fit its template fails here, in each language."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from orchestrator.errors import CauseError
from orchestrator.model import Cause, Decision
from orchestrator.text.catalogue import LANGUAGES, _sentence


def say(cause: Cause | None) -> str:
    """In English; the product shows a mistake as data, here it is an error."""
    if cause is None:
        return ""
    for texts in LANGUAGES.values():
        _sentence(cause, texts)
    return _sentence(cause, LANGUAGES["en"])


def reason_of(decision: Decision) -> str:
    """Why the bay is in its state."""
    return say(decision.cause)


def said(value: object) -> object:
    """A value with all causes in it, however deep, as sentences."""
    if isinstance(value, Cause):
        return say(value)
    if isinstance(value, tuple | list):
        return type(value)(said(one) for one in value)
    return value


def cause(text: str, advice: str = "") -> Cause:
    """A cause whose sentence is exactly this text."""
    return Cause.of("said", advice=advice, text=text)


def into(lines: list[str]) -> Callable[[Cause], None]:
    """Receives causes and keeps their sentences."""
    return lambda cause: lines.append(say(cause))


@contextmanager
def raises(kind: type[CauseError], match: str) -> Iterator[pytest.ExceptionInfo[CauseError]]:
    """Like `pytest.raises`, matching the error's sentence."""
    with pytest.raises(kind) as caught:
        yield caught
    assert re.search(match, say(caught.value.cause)), say(caught.value.cause)
