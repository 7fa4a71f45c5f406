"""Decodes the BMU's words into measurements, by an object map."""

from collections.abc import Iterable

from orchestrator.model import Measurement
from orchestrator.protocol.hextext import byte_count
from orchestrator.protocol.objects import FieldMap, ObjectEntry

#: The decoded raw bits of a field: a value in range; None if the BMU reports "not available" (the reading's field
#: becomes unknown, which is no fault in itself); or a text explaining why they are implausible.
Decoded = Measurement | str | None


def raw_bits(field: FieldMap, word: int) -> int:
    """The field's bits in a word, before sign and scale."""
    return word >> field.first_bit & (1 << field.width) - 1


def decode_word(entry: ObjectEntry, word: int, size: int, t_s: float) -> dict[str, Decoded]:
    """Every field of an object, from the unsigned word in a reply of `size` bytes to a request made at `t_s`."""
    if size != entry.size:
        why = f"0x{entry.index:04X}:{entry.sub:02X} declared {byte_count(size)}, the map says {entry.size}"
        return {field.name: why for field in entry.fields}
    return decode_fields(entry.fields, word, t_s)


def decode_fields(fields: Iterable[FieldMap], word: int, t_s: float) -> dict[str, Decoded]:
    """Every field of a word of the right length, requested at `t_s`."""
    return {field.name: _decode(field, word, t_s) for field in fields}


def _decode(field: FieldMap, word: int, t_s: float) -> Decoded:
    raw = raw_bits(field, word)
    if raw == field.unavailable:
        return None
    signed = raw - (1 << field.width) if field.signed and raw >> (field.width - 1) else raw
    value = round(signed * field.scale + field.offset, 9)  # 29.11, not 29.110000000000003
    if field.range.low <= value <= field.range.high:
        return Measurement(value, t_s)
    return f"{field.name} {value:g} is outside {field.range} (raw 0x{raw:0{(field.width + 3) // 4}X})"
