"""JSON Schema (draft 7) of the five kinds of file, for editors: made from the dataclasses that the reader fills.

It describes each key and its permitted values, so that an editor can complete, explain and check as you type. It cannot
express rules between keys: `orchestrator check` has the final say.
"""

from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from orchestrator.config.files import MAP, POLICY, Kind
from orchestrator.config.policy import Policy
from orchestrator.config.shipped import shipped_names
from orchestrator.config.yaml.scalars import allowed
from orchestrator.config.yaml.schema import INVALID, Slot, slots
from orchestrator.keys import KeyRule, Range
from orchestrator.protocol.objects import ObjectMap

Schema = dict[str, Any]

#: Types that a file refers to by name, and that another file describes.
REFERENCES: Mapping[object, Kind] = {Policy: POLICY, ObjectMap: MAP}
_BOUNDS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}


def json_schema(kind: Kind) -> Schema:
    """The schema of a whole file of this kind."""
    title = f"{kind.about} of a charging station" if kind.key != "station" else "charging station"
    return {"$schema": "http://json-schema.org/draft-07/schema#", "title": title, **_record(kind.content().record)}


def _record(record: type) -> Schema:
    known = slots(record)
    return {
        "type": "object",
        "properties": {name: _slot(slot) for name, slot in known.items()},
        "required": [name for name, slot in known.items() if slot.default is INVALID],
        "additionalProperties": False,
    }


def _slot(slot: Slot) -> Schema:
    schema = {"description": _description(slot.key), **_value(slot.hint, slot.key)}
    default = slot.default.name.lower() if isinstance(slot.default, Enum) else slot.default
    if isinstance(default, (bool, int, float, str, NoneType)) and default != "":
        schema["default"] = default
    return schema


def _description(key: KeyRule) -> str:
    bounds = allowed(key) or key.unit
    return f"{key.about} ({bounds})" if bounds else key.about


def _value(hint: Any, key: KeyRule) -> Schema:  # noqa: ANN401 - any type expression
    if get_origin(hint) in (Union, UnionType):
        (inner,) = (arg for arg in get_args(hint) if arg is not NoneType)
        return _or_null(_value(inner, key))
    if get_origin(hint) is tuple:
        return {"type": "array", "items": _value(get_args(hint)[0], key), "minItems": 1}
    if get_origin(hint) is Mapping:
        return {"type": "object", "additionalProperties": _value(get_args(hint)[1], key), "minProperties": 1}
    if hint is Range:
        return {"type": "array", "items": _value(float, key), "minItems": 2, "maxItems": 2}
    if hint in REFERENCES:
        return _reference(REFERENCES[hint])
    if isinstance(hint, type) and issubclass(hint, Enum):
        return {"enum": [member.name.lower() for member in hint]}
    scalar = _scalar(hint, key)
    return _record(hint) if scalar is None else scalar


def _scalar(hint: object, key: KeyRule) -> Schema | None:
    """The schema of a number, a text …; None for anything else."""
    bounds = {_BOUNDS[name]: bound for name in _BOUNDS if (bound := getattr(key, name)) is not None}
    scalars: dict[object, Schema] = {
        float: {"type": "number", **bounds},
        int: {"type": "integer", **bounds},
        bool: {"type": "boolean"},
        str: {"type": "string", "minLength": 1, **({"pattern": "/"} if key.is_path else {})},
        Path: {"type": "string", "minLength": 1},
        object: {},  # anything: passed unchanged to a library
    }
    return scalars.get(hint)


def _reference(kind: Kind) -> Schema:
    """The name of a shipped file, or a path."""
    return {"anyOf": [{"enum": list(shipped_names(kind.folder))}, {"type": "string", "pattern": r"/|\.ya?ml$"}]}


def _or_null(schema: Schema) -> Schema:
    if "type" in schema:
        return {**schema, "type": [schema["type"], "null"]}
    return {"anyOf": [schema, {"type": "null"}]}
