"""JSON Schema (draft 7) of the status document, made from its records. Pure."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, NotRequired, Union, get_args, get_origin, get_type_hints, is_typeddict

from orchestrator.model.bay_document import Status
from orchestrator.model.document import VERSION

Schema = dict[str, Any]

SCALARS: Mapping[object, str] = {str: "string", float: "number", int: "integer", bool: "boolean"}


@dataclass(frozen=True, slots=True)
class Member:
    """One member of a record."""

    name: str
    kind: Any  #: its type; for a list, that of its items, without null
    about: str
    words: tuple[str, ...]  #: those that it may be; empty: any
    is_list: bool
    may_be_null: bool
    may_be_missing: bool

    @property
    def record(self) -> type | None:
        """The record that it is, or its items are."""
        return self.kind if is_typeddict(self.kind) else None


def members(record: type) -> Iterator[Member]:
    """Of this record, in its order, inherited ones first."""
    for name, hint in get_type_hints(record, include_extras=True).items():
        bare, said = _bare(hint, ())
        null = get_origin(bare) in (Union, UnionType)
        kind = next(one for one in get_args(bare) if one is not NoneType) if null else bare
        is_list = get_origin(kind) is list
        texts, words = (
            [one for one in said if isinstance(one, str)],
            [one for one in said if isinstance(one, tuple)],
        )
        yield Member(
            name,
            get_args(kind)[0] if is_list else kind,
            about=texts[-1] if texts else "",
            words=tuple(map(str, words[-1])) if words else (),
            is_list=is_list,
            may_be_null=null,
            may_be_missing=get_origin(hint) is NotRequired,
        )


def _bare(hint: Any, said: tuple[object, ...]) -> tuple[Any, tuple[object, ...]]:  # noqa: ANN401 - any type expression
    """The type alone, and what is said of it."""
    if get_origin(hint) is Annotated:
        return _bare(get_args(hint)[0], (*hint.__metadata__, *said))
    return _bare(get_args(hint)[0], said) if get_origin(hint) is NotRequired else (hint, said)


def about(record: type) -> str:
    """What a record is."""
    return " ".join((record.__doc__ or "").split())


def status_schema() -> Schema:
    """The schema of the whole document. Names that are not in it may come; readers ignore them."""
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "title": f"status {VERSION}"}
    return {**head, **_record(Status)}


def _record(record: type) -> Schema:
    known = list(members(record))
    return {
        "type": "object",
        "description": about(record),
        "properties": {one.name: _member(one) for one in known},
        "required": [one.name for one in known if not one.may_be_missing],
    }


def _member(member: Member) -> Schema:
    schema = _kind(member)
    if member.about:
        schema = {**schema, "description": member.about}
    if member.may_be_null:
        return {**schema, "type": [schema["type"], "null"], **_or_none(schema)}
    return schema


def _or_none(schema: Schema) -> Schema:
    return {"enum": [*schema["enum"], None]} if "enum" in schema else {}


def _kind(member: Member) -> Schema:
    if member.is_list:
        items = _record(member.kind) if member.record is not None else {"type": SCALARS[member.kind]}
        return {"type": "array", "items": items}
    if member.record is not None:
        return _record(member.kind)
    if get_origin(member.kind) is Mapping:
        return {"type": "object"}
    return {"type": SCALARS[member.kind], **({"enum": list(member.words)} if member.words else {})}
