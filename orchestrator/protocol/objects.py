"""The BMU's object map: which CANopen object holds which field, in which bits. It is data: the document leaves it open.

Source: CANopen manual §1.5 (names and order of the fields), §4.1 (the only sample). Words are little-endian on the wire
(§3); here a word is already an unsigned integer.
"""

from dataclasses import dataclass, field, fields
from enum import StrEnum

from orchestrator.keys import Range, Source, key
from orchestrator.model import BatteryReading

#: The permitted field names of a map.
READING_FIELDS = tuple(each.name for each in fields(BatteryReading))


class Evidence(StrEnum):
    """How certain a row of the map is."""

    DOCUMENTED = "documented"  #: stated in the device's document
    INFERRED = "inferred"  #: the only sensible reading of a documented sample
    ASSUMED = "assumed"  #: check on hardware before relying on it


class Sweep(StrEnum):
    """How often an object is read."""

    FAST = "fast"  #: every sweep, while current flows or a charge is about to begin
    MEDIUM = "medium"  #: twice a second
    SLOW = "slow"  #: once a second


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldMap:
    """One value inside an object's word: raw = (word >> first_bit) & mask; value = raw × scale + offset."""

    name: str = key("what it is: a field of the battery reading, e.g. voltage_v")
    first_bit: int = key("the lowest bit", ge=0, le=31)
    width: int = key("how many bits", ge=1, le=32)
    signed: bool = key("two's complement", default=False)
    scale: float = key("unit of one raw count", default=1.0)
    offset: float = key("added after scaling", default=0.0)
    range: Range = key("a value outside is a fault, not a number to charge by")
    unavailable: int | None = key("the raw value that means: not available", ge=0, default=None)
    evidence: Evidence = key("documented, inferred or assumed")


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectEntry:
    """One object of the BMU's dictionary."""

    index: int = key("object index, e.g. 0x6000", ge=0x1000, le=0xFFFF)
    sub: int = key("sub-index", ge=0, le=255, default=0)
    size: int = key("bytes that the SDO answer must declare: 1, 2 or 4", ge=1, le=4)
    sweep: Sweep = key("fast: every sweep, at rest twice a second; medium: twice a second; slow: once a second")
    fields: tuple[FieldMap, ...] = key("the values inside")


@dataclass(frozen=True, slots=True, kw_only=True)
class TpdoEntry:
    """The content of one TPDO: whole objects, consecutive from byte 0."""

    number: int = key("1, 2 or 3 (COB-ID 0x180, 0x280, 0x380 + node id)", ge=1, le=3)
    objects: tuple[int, ...] = key("the indexes of the objects, in order")


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectMap:
    """One object-map file."""

    map: str = key("the map's name")
    about: str = key("one line for people", default="")
    objects: tuple[ObjectEntry, ...] = key("the objects that are read")
    tpdos: tuple[TpdoEntry, ...] = key("what the TPDOs carry, where they are used", default=())
    source: Source = field(default=Source("<map>"), compare=False)
