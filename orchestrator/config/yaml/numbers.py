"""What somebody meant who wrote a number in a way that we refuse: what to write instead.

Whatever a person types on a phone, a Korean keyboard or from a data sheet comes here; a message names the right form
only if there is one.
"""

import math
import re
from collections.abc import Callable, Sequence
from itertools import pairwise
from unicodedata import normalize

from orchestrator.config.yaml.tree import Items, Node, Scalar
from orchestrator.config.yaml.units import without_unit
from orchestrator.keys import KeyRule

NUMBER = re.compile(r"[-+]?(0|[1-9]\d*)(\.\d+)?", re.ASCII)
HEX = re.compile(r"0x[\da-fA-F]+", re.ASCII)
MAX_DIGITS = 40  #: in a number; more is nonsense

_RANGE = re.compile(
    r"[([{]?\s*([-+]?\d+(?:\.\d+)?)\s*(?:°\s*C?|℃|C|V|A|%)?"
    r"\s*(?:\.\.+|…|-|–|~|to|,|;|:|/|\s)\s*"
    r"([-+]?\d+(?:\.\d+)?)\s*(?:°\s*C?|℃|C|V|A|%)?\s*[)\]}]?",
    re.ASCII,
)
#: Hexadecimal as it is written elsewhere: 1A, 0X1A, x1A, $1A, 1Ah.
_LIKE_HEX = re.compile(r"(?P<prefix>0?x *|\$|#)?(?P<digits>[\da-f]{1,4})(?P<suffix>h)?", re.I | re.A)
#: Letters that look like digits.
_LETTERS = str.maketrans("OoQlI|", "000111")
#: Characters that look like those of a number, and are not NFKC's business.
_SIGNS = str.maketrans("−–·", "--.")


def shown(text: str) -> str:
    """Text from the file, quoted and shortened for a message."""
    return repr(text if len(text) <= MAX_DIGITS else text[: MAX_DIGITS - 1] + "…")


def why_no_number(node: Scalar, key: KeyRule, *, whole: bool = False) -> str:
    """Why this is not a number, and what to write. `whole`: hexadecimal would do as well."""
    kind = f"a number in {key.unit}" if key.unit else "a number"
    text = node.text.strip()
    if not text:
        return f"needs {kind}: {key.about}"
    if not node.plain and (NUMBER.fullmatch(text) or (whole and HEX.fullmatch(text))):
        return f"write {text} without quotes"
    if len(text) <= MAX_DIGITS:
        if whole and not key.unit and (meant := _hexadecimal(text, key)):
            return f"write {meant}, not {text}: hexadecimal begins with 0x"
        if meant := _lookalike(text, whole=whole):
            return meant
        for pattern, say in _HABITS:
            if (match := pattern.fullmatch(text)) and (said := say(match)):
                return said
        if match := _WITH_UNIT.fullmatch(_COMMA.sub(r"\1.\2", text)):
            return without_unit(text, match[1], match[2], key.unit)
    return f"{shown(node.text)} is not {kind}"


def range_meant(node: Node) -> tuple[str, str]:
    """`[low, high]` for a range in another notation, or "", and what is wrong with the number of values, or ""."""
    texts = _texts(node)
    if len(texts) == 1:
        match = _RANGE.fullmatch(texts[0].strip()) if len(texts[0]) <= MAX_DIGITS else None
        return (f"[{match[1]}, {match[2]}]" if match else ""), ""
    meant = _paired(texts) if len(texts) == 4 else ""
    return meant, f", two numbers (2.5, not 2,5), not {len(texts)}" if texts else ""


def decimals_meant(node: Items) -> str:
    """`[2.0, 5.0, 8.5]` for [2,0, 5,0, 8,5], a rising list whose decimals have commas; "" for another list."""
    texts = _texts(node)
    meant = _paired(texts) if len(texts) >= 6 and all(len(text) == 1 for text in texts[1::2]) else ""
    return meant if meant and _rises(meant[1:-1].split(", ")) and not _rises(texts) else ""


def _texts(node: Node) -> list[str]:
    """The scalars in a list, or the one that stands alone."""
    items = node.items if isinstance(node, Items) else (node,)
    return [item.text if isinstance(item, Scalar) else "" for item in items if isinstance(node, Items | Scalar)]


def _paired(texts: Sequence[str]) -> str:
    """`[26.0, 55.2]` for the texts 26, 0, 55, 2; "" if they are not whole numbers in pairs."""
    if len(texts) % 2 or not all(re.fullmatch(r"[-+]?\d{1,4}", text, re.ASCII) for text in texts):
        return ""
    return f"[{', '.join(map('.'.join, zip(texts[::2], texts[1::2], strict=True)))}]"


def _rises(texts: Sequence[str]) -> bool:
    return all(float(low) < float(high) for low, high in pairwise(texts))


def digits_meant(text: str) -> str:
    """The text with digits where it has letters or characters that look like them."""
    return normalize("NFKC", text).translate(_SIGNS).translate(_LETTERS)


def _hexadecimal(text: str, key: KeyRule) -> str:
    """`0x1A` for hexadecimal in another notation that lies within the key's bounds; "" for anything else."""
    match = _LIKE_HEX.fullmatch(text)
    if match is None or not (match["prefix"] or match["suffix"] or re.search("[a-f]", match["digits"], re.I)):
        return ""
    value = int(match["digits"], 16)
    low, high = (bound if bound is not None else limit for bound, limit in ((key.ge, 0), (key.le, math.inf)))
    return f"0x{value:02X}" if low <= value <= high else ""


def _lookalike(text: str, *, whole: bool) -> str:
    meant = digits_meant(text)
    if meant == text or not (NUMBER.fullmatch(meant) or (whole and HEX.fullmatch(meant))):
        return ""
    if not re.search(r"\d", normalize("NFKC", text)):
        return ""  # a word
    return f"write {meant}: {shown(text)} has a letter or a sign that only looks like it"


def _number(text: str) -> str:
    """The correct form of a number written in another notation; "" if it is not a number."""
    try:
        value = float(text)
    except ValueError:
        return ""
    return f"{value:.10f}".rstrip("0").rstrip(".") if math.isfinite(value) and abs(value) < 1e15 else ""


def _instead(number: str, text: str) -> str:
    return f"write {number}, not {text}" if number else ""


def _sexagesimal(match: re.Match[str]) -> str:
    parts = [float(part) for part in match[0].split(":")]
    whole = "h:min:s" if len(parts) > 2 else "h:min or min:s"
    return f"{match[0]} looks like a time ({whole}) and would be read as {_base60(parts):g}: write one number"


def _base60(parts: list[float]) -> float:
    total = 0.0
    for part in parts:
        total = total * 60 + part
    return total


#: Number notations that we refuse, and the message for each; the first match is used.
_HABITS: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], str]], ...] = (
    (re.compile(r"\d+(:\d+(\.\d+)?)+", re.A), _sexagesimal),
    (re.compile(r"[-+]?\.(nan|inf)|[-+]?(nan|inf|infinity)", re.I), lambda m: f"{m[0]} is not a number to charge by"),
    (re.compile(r"0x[\da-f]+", re.I | re.A), lambda m: f"write it in decimal: {int(m[0], 16)}, not {m[0]}"),
    (re.compile(r"0o[0-7]+", re.A), lambda m: f"write it in decimal: {int(m[0], 8)}, not {m[0]}"),
    (re.compile(r"0b[01]+", re.A), lambda m: f"write it in decimal: {int(m[0], 2)}, not {m[0]}"),
    (
        re.compile(r"0\d+", re.A),
        lambda m: f"{m[0]} with a leading 0 may be read as octal: write {m[0].lstrip('0') or 0}",
    ),
    (re.compile(r"([-+]?\d+),(\d+)", re.A), lambda m: f"use a decimal point: {m[1]}.{m[2]}, not {m[0]}"),
    (re.compile(r"[-+]?\d[\d_.]*_[\d_.]*", re.A), lambda m: _instead(_number(m[0].replace("_", "")), m[0])),
    (re.compile(r"[-+]?[\d.]+e[-+]?\d+", re.I | re.A), lambda m: _instead(_number(m[0]), m[0])),
    (re.compile(r"[-+]?(\d+\.|\.\d+|0+\d+\.\d*)", re.A), lambda m: _instead(_number(m[0]), m[0])),
    (re.compile(r"[~<>=≤≥≈±] *([-+]?\d+(\.\d+)?)", re.A), lambda m: f"only the number: {m[1]}, not {m[0]}"),
    (re.compile(r"([-+]?[\d.]+)[;,.]", re.A), lambda m: _instead(_number(m[1]), m[0])),
    (re.compile(r"([-+]?[\d.]+ *; *)+[-+]?[\d.]+", re.A), lambda m: f"write {m[0].replace(';', ',')}, not {m[0]}"),
    (re.compile(r"(\d+)s\d+p", re.I | re.A), lambda m: f"only the cells in series: {m[1]}, not {m[0]}"),
)
_COMMA = re.compile(r"^([-+]?\d+),(\d+)", re.ASCII)
_WITH_UNIT = re.compile(r"(?!0[xo]|[\d.]+[eE][-+]?\d)([-+]?\d+(?:\.\d+)?) *([^\d.,:;_\s]\D*)", re.ASCII)
