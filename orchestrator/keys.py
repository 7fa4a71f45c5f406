"""Describes each key of a YAML file once, beside the field that holds it.

The strict reader, `orchestrator check` and the JSON Schema use these descriptions.
"""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class KeyRule:
    """A key's meaning and permitted values; bounds are inclusive (`ge`, `le`) or exclusive (`gt`, `lt`)."""

    about: str
    unit: str = ""
    ge: float | None = None
    le: float | None = None
    gt: float | None = None
    lt: float | None = None
    is_path: bool = False  #: the path of a device file, relative to the YAML file


def key(
    about: str,
    *,
    unit: str = "",
    ge: float | None = None,
    le: float | None = None,
    gt: float | None = None,
    lt: float | None = None,
    is_path: bool = False,
    default: Any = MISSING,  # noqa: ANN401 - as in dataclasses.field
    default_factory: Callable[[], Any] | None = None,
) -> Any:  # noqa: ANN401 - as dataclasses.field, so that the field keeps its own type
    """A dataclass field filled from a YAML key. Without a default the key is required."""
    metadata = {"key": KeyRule(about, unit, ge, le, gt, lt, is_path)}
    if default_factory is not None:
        return field(default_factory=default_factory, metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, slots=True)
class Range:
    """A closed interval, written `[low, high]` in YAML; low < high."""

    low: float
    high: float

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    def __str__(self) -> str:
        return f"{self.low:g} … {self.high:g}"


@dataclass(frozen=True, slots=True)
class Source:
    """The file that a configuration came from, and the line of each key (`current.soc_pct[1]` → 41)."""

    file: str
    lines: Mapping[str, int] = field(default_factory=dict, hash=False)
    digest: str = ""  #: the file's SHA-256, as `sha256sum` shows it; people are shown the first twelve digits

    def at(self, path: str) -> str:
        """`FILE:LINE` of the key at `path`, or of its nearest parent in the file."""
        while path and path not in self.lines:
            path = path[: max(path.rfind("."), path.rfind("["), 0)]
        return f"{self.file}:{self.lines[path]}" if path else self.file
