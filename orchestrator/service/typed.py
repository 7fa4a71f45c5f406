"""Turns plain JSON values back into records, by the types of their fields. Anything that does not fit is refused."""
# ruff: noqa: ANN401 - the types come from the records themselves

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

from orchestrator.model import Cause
from orchestrator.model.cause import from_plain

#: The largest figure ever written; ages are in seconds.
MOST = 1e12


def structure(value: object, kind: Any) -> Any:
    """`value` as a `kind`: a record, mapping, tuple, text, number or truth value. ValueError if it is not one.

    A record's fields may be missing (they have defaults); unknown ones are refused.
    """
    origin = get_origin(kind)
    if origin is UnionType:
        return _optional(value, kind)
    if origin is tuple:
        return _tuple(value, get_args(kind))
    if origin is Mapping:
        return {structure(key, str): structure(one, get_args(kind)[1]) for key, one in _object(value).items()}
    if kind is Cause:
        return from_plain(value)
    if is_dataclass(kind):
        return _record(value, kind)
    return _plain(value, kind)


def _optional(value: object, kind: Any) -> Any:
    (known,) = (one for one in get_args(kind) if one is not NoneType)
    return None if value is None else structure(value, known)


def _tuple(value: object, kinds: tuple[Any, ...]) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise ValueError(f"{value!r:.80} is no list")
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        return tuple(structure(one, kinds[0]) for one in value)
    if len(value) != len(kinds):
        raise ValueError(f"{value!r:.80} has not {len(kinds)} values")
    return tuple(structure(one, kind) for one, kind in zip(value, kinds, strict=True))


def _record(value: object, kind: Any) -> Any:
    known, given = {one.name for one in fields(kind)}, _object(value)
    if not given.keys() <= known:
        raise ValueError(f"{', '.join(sorted(given.keys() - known))!r:.80} is not known")
    hints = get_type_hints(kind)
    try:
        return kind(**{name: structure(one, hints[name]) for name, one in given.items()})
    except TypeError:
        raise ValueError(f"{kind.__name__} lacks one of its values") from None


def _object(value: object) -> dict[str, object]:
    if not isinstance(value, dict):
        raise ValueError(f"{value!r:.80} is no object")
    return value


def _plain(value: object, kind: type) -> Any:
    if kind is float and type(value) in (int, float):
        return _figure(value)
    if type(value) is not kind:
        raise ValueError(f"{value!r:.80} is no {kind.__name__}")
    if isinstance(value, str):
        value.encode()  # a lone surrogate can be neither shown nor written
    elif isinstance(value, int):
        _figure(value)
    return value


def _figure(value: Any) -> float:
    if abs(value) > MOST or not isfinite(value):
        raise ValueError(f"{value!r:.80} is no figure that was ever written")
    return float(value)
