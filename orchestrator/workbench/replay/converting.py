"""Turns the journal's JSON back into the records that were written."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_type_hints

from cattrs import Converter
from cattrs.errors import BaseValidationError

from orchestrator.config.station import BayConfig
from orchestrator.core.memory import Memory, in_parts
from orchestrator.core.rules import Rules
from orchestrator.model import Cause, Snapshot
from orchestrator.model.cause import from_plain
from orchestrator.service.journal_files import Fields
from orchestrator.service.rows import BATTERY, COLUMNS, NUMBERS, OTHERS, RECORDS

_CONVERTER = Converter(detailed_validation=False)
_CONVERTER.register_structure_hook(Path, lambda text, _: Path(text))
_CONVERTER.register_structure_hook(Cause, lambda value, _: from_plain(value))

#: What unreadable lines raise.
UNREADABLE = (BaseValidationError, LookupError, TypeError, ValueError, RecursionError, OverflowError)
#: Why a recording cannot be repeated: it has sentences from an older version, and no causes.
SENTENCES = "an older version of this service has recorded this step: only that version can decide it again"


class OlderError(Exception):
    """A line with sentences where the core now has causes."""


def whole(line: Fields) -> tuple[Fields, Memory, Rules]:
    """The snapshot as JSON, the memory and the rules of a complete line."""
    if "cause" not in line["memory"] or isinstance(line["charger_link"]["problem"], str):
        raise OlderError
    plain = {name: line[name] for name in Snapshot.__slots__ if name in line}  # newer fields get their defaults
    memory = _CONVERTER.structure(in_parts(line["memory"]), Memory)
    if "chemistry" not in line["config"]["policy"]["pack"]:
        raise ValueError("its policy is of the first edition, which spoke of steps: replay it with that version")
    return plain, memory, Rules.of(_CONVERTER.structure(line["config"], BayConfig))


def snapshot_of(plain: Fields) -> Snapshot:
    """The snapshot in a JSON object."""
    return _CONVERTER.structure(plain, Snapshot)


def _maker(kind: Any) -> Callable[[Any], Any]:  # noqa: ANN401 - any type of a field
    return lambda value: _CONVERTER.structure(value, kind)


def _makers() -> dict[str, Callable[[Any], Any]]:
    """How the value of each column is made: column → function of its JSON value."""
    kinds = get_type_hints(Snapshot)
    found = {name: _maker(kinds[name]) for name in (*OTHERS, *RECORDS)}
    for part, record in RECORDS.items():
        inside = get_type_hints(record)
        found |= {column: _maker(inside[name]) for name, column in COLUMNS[part].items()}
    return found


MAKERS: Mapping[str, Callable[[Any], Any]] = _makers()
#: Column → the snapshot's part that it belongs to, and the field in it ("" for the part itself).
PLACES: Mapping[str, tuple[str, str]] = {
    **{column: (part, name) for part, columns in COLUMNS.items() for name, column in columns.items()},
    **{column: ("battery", name) for name, columns in BATTERY.items() for column in columns},
    **{name: ("", name) for name in (*OTHERS, *RECORDS)},
}
BATTERY_TIMES = {time: name for name, (_, time) in BATTERY.items()}
ALL_NUMBERS = NUMBERS | {column for columns in BATTERY.values() for column in columns}
