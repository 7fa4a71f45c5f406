"""Compares object maps: how each decodes a BMU's words, the evidence against it, and which fits best. Pure."""

from collections.abc import Iterator, Mapping
from itertools import chain

from orchestrator.model import Cause, Measurement
from orchestrator.protocol.objects import READING_FIELDS, ObjectMap
from orchestrator.protocol.pages import PAGES
from orchestrator.protocol.words import Decoded, decode_word
from orchestrator.text.catalogue import say

Key = tuple[int, int]
Values = Mapping[str, Decoded]

#: Two readings of a quantity, a second apart, agree if they differ by at most this share, or this many counts.
AGREE_SHARE, AGREE_COUNTS = 0.05, 5


def comparison(
    maps: Mapping[str, ObjectMap], chosen: ObjectMap, words: Mapping[Key, tuple[int, int]], pages: Values
) -> Iterator[str]:
    """Every value by every map (and by the older protocol's pages), aligned; then the evidence against each map.

    `words` are the objects' raw words and the sizes declared by the answers.
    """
    decoded = {name: decode(one, words) for name, one in maps.items()}
    columns: dict[str, Values] = {**decoded, **({"older protocol": pages} if pages else {})}
    width = max(13, *(len(name) + 2 for name in columns))
    yield f"{'value':17} " + " ".join(f"{name:>{width}}" for name in columns)
    for field in READING_FIELDS:
        yield f"{field:17} " + " ".join(f"{_cell(field, values):>{width}}" for values in columns.values())
    wrong = {name: list(_wrong(maps[name], values, pages)) for name, values in decoded.items()}
    for name, reasons in wrong.items():
        yield f"map {name}: {'; '.join(reasons) or 'nothing speaks against it'}"
    yield _advice(maps, chosen, wrong)


def decode(one: ObjectMap, words: Mapping[Key, tuple[int, int]]) -> Values:
    """What these words mean by this map."""
    values: dict[str, Decoded] = {}
    for entry in one.objects:
        word = words.get((entry.index, entry.sub))
        if word is not None:
            values |= decode_word(entry, *word, 0.0)
    return values


def _cell(field: str, values: Values) -> str:
    value = values.get(field, "")
    if isinstance(value, Measurement):
        return f"{value.value:g}"
    return "not available" if value is None else "cannot be" if value else "–"


def _wrong(one: ObjectMap, values: Values, pages: Values) -> Iterator[str]:
    """Implausible values, and contradictions with the older protocol."""
    yield from (say(value) for value in values.values() if isinstance(value, Cause))
    fields = chain(*(entry.fields for entry in one.objects), *PAGES.values())
    scales = {field.name: field.scale for field in fields}
    for name, page in pages.items():
        value = values.get(name)
        if isinstance(value, Measurement) and isinstance(page, Measurement):
            allowed = max(AGREE_SHARE * abs(page.value), AGREE_COUNTS * abs(scales[name]))
            if name == "status":  # bits, not a quantity
                allowed = 0.0
            if abs(value.value - page.value) > allowed:
                yield f"{name} {value.value:g}, but {page.value:g} by the older protocol"


def _advice(maps: Mapping[str, ObjectMap], chosen: ObjectMap, wrong: Mapping[str, list[str]]) -> str:
    yours = next(name for name, one in maps.items() if one == chosen)
    best = min(wrong, key=lambda name: (len(wrong[name]), name != yours))
    if best != yours:
        return f"→ the station file says map {yours}, but {best} fits better: set battery.map, check, and probe again"
    return f"→ map {yours}, as in the station file. Compare with the pack's label, a voltmeter and a thermometer"
