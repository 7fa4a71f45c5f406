"""Names of parameter values in test ids, where pytest itself would only number them."""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from typing import Any

#: Ids should fit on one line, and some values are long.
LONGEST = 56
MOST_BYTES = 24


def name_of(value: object) -> str | None:
    """None where pytest's own id is as good."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, str):
        return short(" ".join(value.split())) if len(value) > LONGEST or "\n" in value.strip() else None
    if value is None or isinstance(value, (bool, int, float, complex, type)):
        return None
    return short(shown(value))


def shown(value: object) -> str:
    """Any value in few words."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, (bytes, bytearray)):
        return _hex(bytes(value))
    if isinstance(value, Mapping):
        return " ".join(f"{shown(key)}={shown(item)}" for key, item in value.items()) or "nothing"
    if isinstance(value, AbstractSet):
        return " ".join(sorted(map(shown, value))) or "nothing"  # the same in every process: sets have no order
    if isinstance(value, Sequence) and not isinstance(value, (str, range)):
        return " ".join(map(shown, value)) or "nothing"
    if is_dataclass(value) and not isinstance(value, type) and type(value).__str__ is object.__str__:
        return _record(value)
    if isinstance(value, BaseException):
        return f"{type(value).__name__} {value}".strip()
    name = getattr(value, "__name__", None)
    return str(name) if name is not None else str(value)


def short(text: str, longest: int = LONGEST) -> str:
    """Cut to the maximum length of an id."""
    return text if len(text) <= longest else f"{text[: longest - 2].rstrip()}.."


def _hex(data: bytes) -> str:
    if len(data) > MOST_BYTES:
        return f"{data[:MOST_BYTES].hex(' ').upper()} .. ({len(data)} bytes)"
    return data.hex(" ").upper() or "no bytes"


def _record(value: Any) -> str:
    """By its name, if it has one (a policy's is in `policy`), or by its differences from the defaults."""
    kind = type(value).__name__
    for name in (getattr(value, "name", None), getattr(value, kind.lower(), None)):
        if isinstance(name, str) and name:
            return name
    told = {field.name: getattr(value, field.name) for field in fields(value) if field.repr}
    changed = [f"{name}={shown(one)}" for name, one in told.items() if one != _default(value, name)]
    return " ".join((kind, *changed))


def _default(value: Any, name: str) -> object:
    field: Field[object] = next(field for field in fields(value) if field.name == name)
    return field.default_factory() if field.default_factory is not MISSING else field.default
