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


def fits(decision: Decision) -> None:
    """Every cause in the decision can be said, with all of its figures, and every key stands somewhere."""
    step, session = decision.step, decision.session
    causes = [decision.cause, decision.answer, step and step.rule, *((session.full, session.result) if session else ())]
    for fault in decision.faults:
        kind = fault.effect, fault.gone_s is None, decision.state, fault.id, _shape(fault.raised)
        if kind not in _SAID:
            causes += fault.told, fault.raised
            _SAID.add(kind)
    for cause in causes:
        if cause is not None and (shape := _shape(cause)) not in _SAID:
            _figures(cause)
            say(cause)
            _SAID.add(shape)


#: The shapes of the causes that were said so far: each is said once, because they come with every decision.
_SAID: set[object] = set()


def _shape(value: object) -> object:
    if isinstance(value, Cause):
        params = tuple((name, _shape(one)) for name, one in value.params)
        return value.id, value.key, not value.place, value.advice, params
    if isinstance(value, tuple):
        return tuple(map(_shape, value))
    return value if isinstance(value, str | bool) else type(value)


#: What a cause may tell, but need not: None is nothing.
MAY_BE_NOTHING = frozenset({"held", "last", "limited", "rises", "strike", "then", "value", "what", "wrong"})


def _figures(cause: Cause) -> None:
    for name, value in cause.params:
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, Cause):
                _figures(one)
            else:
                known = one is None and name in MAY_BE_NOTHING
                assert known or isinstance(one, str | int | float), f"{cause}: no {name}"
    assert isinstance(cause.key, str)
    assert "." not in cause.key or cause.place, f"{cause} does not say where its key stands"


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
