"""Reasons as data: programs compare them, and sentences in any language are made from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from orchestrator.model.told import CauseFields

#: The deepest nesting of causes; no real cause comes near it.
DEPTH = 10
#: Several causes at once, in `whats`.
SEVERAL = "several"
#: A mere sentence, in `text`.
SAID = "said"
#: The members of a cause in JSON.
PARTS = frozenset({"id", "params", "key", "place", "advice", "text"})


@dataclass(frozen=True, slots=True)
class Cause:
    """One cause. Two are the same if `id` and `key` match: figures change constantly, and texts with the language.

    `params` are (name, value) pairs with units in the names: numbers, words of a fixed list, other causes, tuples of
    these.
    """

    id: str
    params: tuple[tuple[str, Any], ...] = ()
    key: str = ""  #: path of the policy or station key that sets the limit: "pack.temperature_c"
    place: str = ""  #: where that key is: FILE:LINE
    advice: str = ""  #: the id of the advice

    @classmethod
    def of(cls, id_: str, /, *, key: str = "", place: str = "", advice: str = "", **params: Any) -> "Cause":  # noqa: ANN401 - as `params`
        """Make a cause from keyword parameters."""
        return cls(id_, tuple(params.items()), key, place, advice)

    def same_as(self, other: "Cause | None") -> bool:
        """Whether both are the same cause, whatever their figures."""
        return other is not None and self.id == other.id and self.key == other.key

    def param(self, name: str) -> Any:  # noqa: ANN401 - as `params`
        """The parameter with this name; None if there is none."""
        for known, value in self.params:  # many are asked for in each decision: no generator
            if known == name:
                return value
        return None

    def with_(self, advice: str = "", **params: Any) -> "Cause":  # noqa: ANN401 - as `params`
        """The same cause with more parameters, and with this advice."""
        return Cause(self.id, (*self.params, *params.items()), self.key, self.place, advice or self.advice)


def together(causes: Sequence[Cause]) -> Cause:
    """One cause for all of them; a single cause is returned as is."""
    return causes[0] if len(causes) == 1 else Cause.of(SEVERAL, whats=tuple(causes))


def without_then(cause: Cause, *, advice: bool = True) -> Cause:
    """The cause without what comes next, and without `advice` if that is over: in several causes, of each of them."""
    params = tuple(
        (
            name,
            tuple(without_then(one, advice=advice) for one in value)
            if (cause.id, name) == (SEVERAL, "whats")
            else value,
        )
        for name, value in cause.params
        if name != "then"
    )
    return Cause(cause.id, params, cause.key, cause.place, cause.advice if advice else "")


def parts(cause: Cause) -> tuple[Cause, ...]:
    """The causes that were put together; a single one is its own only part."""
    whats = cause.param("whats") if cause.id == SEVERAL else None
    return tuple(one for one in whats or (cause,) if isinstance(one, Cause))


def said(text: str) -> Cause:
    """A sentence of which nobody knows more: one from before there were causes, or of no account."""
    return Cause.of(SAID, text=text)


def plain(cause: Cause) -> CauseFields:
    """The cause as a JSON value; `from_plain` is the inverse."""
    return {
        "id": cause.id,
        "params": {name: _plain(value) for name, value in cause.params},
        "key": cause.key,
        "place": cause.place,
        "advice": cause.advice,
    }


def _plain(value: Any) -> object:  # noqa: ANN401 - as `params`
    if isinstance(value, Cause):
        return plain(value)
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def from_plain(value: object, depth: int = DEPTH) -> Cause:
    """The cause in a JSON value; ValueError for anything else. A `text` beside it is ignored: texts are generated.

    Parameters may be an object, or a list of pairs as produced by `dataclasses.asdict`.
    """
    if not depth or not isinstance(value, Mapping) or not value.keys() <= PARTS or not value.get("id"):
        raise ValueError(f"{value!r:.80} is no cause")
    texts = [value.get(name, "") for name in ("id", "key", "place", "advice")]
    params = value.get("params", ())
    pairs = list(params.items()) if isinstance(params, Mapping) else params
    if not isinstance(pairs, list | tuple) or not all(isinstance(text, str) for text in texts):
        raise ValueError(f"{value!r:.80} is no cause")
    id_, key, place, advice = map(str, texts)
    f"{id_}{key}{place}{advice}".encode()  # as below
    return Cause(id_, tuple(_pair(pair, depth) for pair in pairs), key, place, advice)


def _pair(pair: Any, depth: int) -> tuple[str, Any]:  # noqa: ANN401 - it is judged here
    if not isinstance(pair, list | tuple) or len(pair) != 2 or not isinstance(pair[0], str):
        raise ValueError(f"{pair!r:.80} is no parameter of a cause")
    return pair[0], _value(pair[1], depth - 1)


def _value(value: object, depth: int) -> object:
    if isinstance(value, Mapping):
        return from_plain(value, depth)
    if isinstance(value, list | tuple) and depth:
        return tuple(_value(one, depth - 1) for one in value)
    if isinstance(value, str):
        value.encode()  # a lone surrogate can be neither shown nor written
    if not isinstance(value, str | int | float | None) or (isinstance(value, float) and not isfinite(value)):
        raise ValueError(f"{value!r:.80} is no parameter of a cause")
    return value
