"""The fields of a request, each of the type and length that it must have. Pure."""

from collections.abc import Mapping

from orchestrator.model import Cause
from orchestrator.northbound.refusal import RefusalError

#: Larger than any moment in Unix seconds.
LARGEST = 1e12


def text_field(asked: Mapping[str, object], name: str, longest: int, default: str | None = None) -> str:
    """A text of one line; RefusalError otherwise."""
    value = asked.get(name, default)
    if not isinstance(value, str) or len(value) > longest or not value.isprintable():
        raise RefusalError(400, Cause.of("field_wrong", name=name, wanted=f"text, 1…{longest}"))
    if not value and default is None:
        raise RefusalError(400, Cause.of("field_wrong", name=name, wanted=f"text, 1…{longest}"))
    return value


def number_field(asked: Mapping[str, str], name: str, most: int, default: int) -> int:
    """A whole number that is not negative; RefusalError otherwise."""
    value = asked.get(name)
    if value is None or value == "":
        return default
    if not value.isascii() or not value.isdigit() or len(value) > 15 or int(value) > most:
        raise RefusalError(400, Cause.of("field_wrong", name=name, wanted=f"0…{most}"))
    return int(value)


def shown_field(asked: Mapping[str, object], name: str) -> float | None:
    """A number as it stands in a document that was shown, None if none is given; RefusalError otherwise."""
    value = asked.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        raise RefusalError(400, Cause.of("field_wrong", name=name, wanted="Unix s"))
    return float(value)


def moment_field(asked: Mapping[str, str], name: str) -> float | None:
    """A moment in Unix seconds; RefusalError otherwise."""
    value = asked.get(name)
    if not value:
        return None
    whole, _, part = value.partition(".")
    if not (whole.isascii() and whole.isdigit() and len(value) <= 20 and (part or "0").isdigit()):
        raise RefusalError(400, Cause.of("field_wrong", name=name, wanted="Unix s"))
    return float(value)
