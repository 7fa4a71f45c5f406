"""Which keys differ between two versions of a configuration, and how. Pure."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, NamedTuple

NONE = "–"
#: The longest value shown.
MOST_SHOWN = 100


class Difference(NamedTuple):
    """One key with its values, as in the file."""

    key: str
    before: str
    after: str


def differences(before: Any, after: Any, key: str = "") -> Iterator[Difference]:  # noqa: ANN401 - any configuration
    """The keys that differ, in the file's order; what only moved in the file does not."""
    if before == after:
        return
    if is_dataclass(before) and type(before) is type(after) and not _is_value(before):
        for one in fields(before):
            if one.compare:
                yield from differences(getattr(before, one.name), getattr(after, one.name), _inside(key, one.name))
    elif isinstance(before, tuple) and isinstance(after, tuple):
        for number in range(max(len(before), len(after))):
            yield from differences(_at(before, number), _at(after, number), f"{key}[{number}]")
    elif isinstance(before, Mapping) and isinstance(after, Mapping):
        for name in dict.fromkeys([*before, *after]):
            yield from differences(before.get(name), after.get(name), _inside(key, str(name)))
    else:
        yield Difference(key, _shown(before), _shown(after))


def _inside(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name


def _at(values: tuple[Any, ...], number: int) -> Any:  # noqa: ANN401 - as above
    return values[number] if number < len(values) else None


def _is_value(value: object) -> bool:
    """Whether it stands in one place of the file: a pair of numbers, say."""
    return type(value).__str__ is not object.__str__


def _shown(value: Any) -> str:  # noqa: ANN401 - as above
    text = _text(value)
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN - 1]}…"


def _text(value: Any) -> str:  # noqa: ANN401 - as above
    if value is None:
        return NONE
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Enum):
        return value.value if isinstance(value.value, str) else value.name.lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    if is_dataclass(value) and not _is_value(value):
        pairs = ((one.name, getattr(value, one.name)) for one in fields(value) if one.compare)
        return f"{{{', '.join(f'{name}: {_text(inside)}' for name, inside in pairs if inside is not None)}}}"
    return str(value)
