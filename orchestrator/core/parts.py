"""What the parts of the memory are made of: frozen records, whose fields say what kind of thing they carry.

Theory of operation. Who leaves steps out, tells two memories apart, or decides a record again with another policy needs
to know what a field is. That stands beside the field itself, so that no list elsewhere has to follow the memory.
"""

from collections.abc import Callable, Iterator
from dataclasses import Field, field, fields, make_dataclass
from enum import Enum, auto
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeVar

from orchestrator.model import State

__all__ = ["Kind", "changed", "event", "made", "measured", "of_kind", "total", "unclassed"]

T = TypeVar("T")
NOWHERE: frozenset[State] = frozenset()


class Kind(Enum):
    """How a field changes."""

    EVENT = auto()  #: only when something happens
    TOTAL = auto()  #: sums up while a condition holds; that there is anything, or nothing any more, is an event
    MEASURED = auto()  #: all the time: values, their times, and what is taken from them


def event(default: T, *, by_policy: bool = False, tells: frozenset[State] = NOWHERE) -> T:
    """A field that changes only when something happens.

    `by_policy`: only what the policy says changes it. `tells`: the states in which it decides, once it is there or not,
    where the bay can go from there.
    """
    return field(default=default, metadata={"kind": Kind.EVENT, "by_policy": by_policy, "tells": tells})


def total(default: float) -> float:
    """A field that sums up."""
    return field(default=default, metadata={"kind": Kind.TOTAL, "by_policy": False, "tells": NOWHERE})


def measured(default: T, *, by_policy: bool = False, tells: frozenset[State] = NOWHERE) -> T:
    """A field that follows the values."""
    return field(default=default, metadata={"kind": Kind.MEASURED, "by_policy": by_policy, "tells": tells})


def of_kind(part: Any, kind: Kind) -> Iterator[str]:  # noqa: ANN401 - any dataclass
    """The names of a record's fields of this kind."""
    return (one.name for one in fields(part) if one.metadata.get("kind") is kind)


def unclassed(part: Any) -> Iterator[Field[Any]]:  # noqa: ANN401 - any dataclass
    """The fields that do not say what they are."""
    return (one for one in fields(part) if "kind" not in one.metadata)


def _twin(cls: type[Any]) -> tuple[Callable[[Any], tuple[Any, ...]], type[Any]]:
    """What reads all values of such a record, and a class of the same slots that can be written to."""
    names = [one.name for one in fields(cls)]
    return attrgetter(*names), make_dataclass(cls.__name__, names, slots=True, eq=False, repr=False, match_args=False)


_TWINS: dict[type[Any], tuple[Callable[[Any], tuple[Any, ...]], type[Any]]] = {}


def made(cls: type[T], /, *values: object) -> T:
    """A frozen record with slots of all these values, three times as fast as by its own constructor.

    That one writes past the record's own guard, field by field; here they are written into the record's twin, which has
    no guard, and is then declared to be the record.
    """
    if cls not in _TWINS:
        _TWINS[cls] = _twin(cls)
    new = _TWINS[cls][1](*values)
    new.__class__ = cls
    return new  # type: ignore[no-any-return]


if TYPE_CHECKING:
    from dataclasses import replace as changed  # checked as that is, by the names and types of the fields
else:

    def changed(part: T, /, **changes: object) -> T:
        """`dataclasses.replace` for frozen records with slots, four times as fast: as in `made`."""
        cls = part.__class__
        twin = _TWINS.get(cls)
        if twin is None:
            twin = _TWINS[cls] = _twin(cls)
        new = twin[1](*twin[0](part))
        for name, value in changes.items():
            setattr(new, name, value)
        new.__class__ = cls
        return new
