"""A number with a unit behind it, where the key's name has the unit: what to write, converted if it is another one."""

from collections.abc import Iterator, Mapping
from unicodedata import normalize

#: What people write for each unit that our keys have → how many of that unit it is.
_WORDS: Mapping[str, Mapping[str, float]] = {
    "A": {"a": 1, "amp": 1, "amps": 1, "ampere": 1, "amperes": 1, "adc": 1, "ma": 0.001, "ka": 1000},
    "V": {"v": 1, "volt": 1, "volts": 1, "vdc": 1, "mv": 0.001, "kv": 1000},
    "Ah": {"ah": 1, "mah": 0.001},
    "°C": {"°c": 1, "° c": 1, "°": 1, "c": 1, "deg": 1, "degrees": 1, "degc": 1, "celsius": 1},
    "%": {"%": 1, "percent": 1, "pct": 1},
    "MB": {"mb": 1, "m": 1, "gb": 1000, "g": 1000, "kb": 0.001},
    "C": {"c": 1},
}
_SECONDS: Mapping[str, float] = {
    **dict.fromkeys(("ms", "msec"), 0.001),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1),
    **dict.fromkeys(("min", "mins", "minute", "minutes"), 60),
    **dict.fromkeys(("h", "hr", "hrs", "hour", "hours"), 3600),
    **dict.fromkeys(("d", "day", "days"), 86_400),
}


def without_unit(text: str, number: str, unit_written: str, unit: str) -> str:
    """What to write instead of `text`, which is `number` with a unit behind it; the key's own `unit` may be ""."""
    word, plain = normalize("NFKC", unit_written).casefold(), f"only the number, without a unit: {number}, not {text}"
    if not unit or word not in set(_known()):
        return plain
    words = _SECONDS if unit in _SECONDS else _WORDS.get(unit, {})
    if word not in words:
        c = "; C belong to a key of their own, such as max_c" if (unit, word) == ("A", "c") else ""
        return f"{text} is no number in {unit}: write how many {unit} are meant{c}"
    factor = words[word] / (_SECONDS[unit] if words is _SECONDS else 1)
    return plain if factor == 1 else f"write {float(number) * factor:.10g}, in {unit}, not {text}"


def _known() -> Iterator[str]:
    yield from _SECONDS
    for words in _WORDS.values():
        yield from words
