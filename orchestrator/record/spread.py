"""Each measured value of a charge: at its begin, last, lowest and highest. Pure."""

from collections.abc import Mapping, Sequence

from orchestrator.record.look import VALUES
from orchestrator.record.stamp import figure

Spread = tuple[float, float, float, float]  #: first, last, lowest, highest
#: As records name them.
PARTS = ("begin", "end", "lowest", "highest")
#: Of every value in `VALUES`; None: never known.
Spreads = tuple[Spread | None, ...]
NONE: Spreads = (None,) * len(VALUES)


def follow(spreads: Spreads, values: Sequence[float | None]) -> Spreads:
    """The same with the present values."""
    return tuple(map(_with, spreads, values))


def _with(spread: Spread | None, value: float | None) -> Spread | None:
    if value is None:
        return spread
    if spread is None:
        return value, value, value, value
    first, last, lowest, highest = spread
    return spread if value == last else (first, value, min(lowest, value), max(highest, value))


def as_fields(spreads: Spreads) -> dict[str, object]:
    """As they stand in a record: null where nothing was known."""
    return {
        name: dict(zip(PARTS, spread, strict=True)) if spread else None
        for name, spread in zip(VALUES, spreads, strict=True)
    }


def from_fields(record: Mapping[str, Mapping[str, object] | None]) -> Spreads:
    """The inverse; raises LookupError, TypeError or ValueError for anything else."""
    return tuple(_spread(record.get(name)) for name in VALUES)


def _spread(value: Mapping[str, object] | None) -> Spread | None:
    if value is None:
        return None
    first, last, lowest, highest = (figure(value[part]) for part in PARTS)
    return first, last, lowest, highest
