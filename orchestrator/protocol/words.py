"""Decodes the BMU's words into measurements, by an object map."""

from collections.abc import Iterable

from orchestrator.model import Cause, Measurement
from orchestrator.protocol.objects import FieldMap, ObjectEntry

#: What a field's newest raw bits turned out to be: a value in range; None where the BMU says that it has none (so a
#: reading's field becomes unknown, which is no fault by itself); or why they cannot be believed.
Decoded = Measurement | Cause | None


def raw_bits(field: FieldMap, word: int) -> int:
    """The field's bits in a word, before sign and scale."""
    return word >> field.first_bit & (1 << field.width) - 1


def decode_word(entry: ObjectEntry, word: int, size: int, t_s: float) -> dict[str, Decoded]:
    """Every field of an object, from the unsigned word in a reply of `size` bytes to a request made at `t_s`."""
    if size != entry.size:
        why = Cause.of("size_differs", index=entry.index, sub=entry.sub, size=size, expected=entry.size)
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
    low, high, digits = field.range.low, field.range.high, (field.width + 3) // 4
    return Cause.of("value_outside", field=field.name, value=value, low=low, high=high, raw=f"0x{raw:0{digits}X}")
