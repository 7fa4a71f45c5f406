"""Converts a scalar's text to the type that its key expects, or says what should have been written.

YAML's own type resolution is not used: it reads `on` as true, `1:30` as 90, `012` as 10, `19:20:00` as 69600 and `1e3`
as text. Here the key determines the type; anything that other YAML readers would read differently is refused.
"""

import re
from collections.abc import Iterable
from difflib import SequenceMatcher
from enum import Enum

from orchestrator.config.yaml.numbers import HEX, MAX_DIGITS, NUMBER, shown, why_no_number
from orchestrator.config.yaml.tree import Scalar
from orchestrator.keys import KeyRule

_NULL = re.compile(r"~|null", re.IGNORECASE)
_TRUE = {"true", "yes", "on", "y", "1"}
_FALSE = {"false", "no", "off", "n", "0"}
_NOTHING = _FALSE | {"none"}  #: for the word `off`
_RANGE = re.compile(r"([-+]?\d+(?:\.\d+)?)\s*(?:\.\.+|…|-|–|~|to|,|;|:|/)\s*([-+]?\d+(?:\.\d+)?)", re.ASCII)
_URL = re.compile(r"[a-z][a-z\d+.-]*://", re.IGNORECASE)
_ALIKE = 0.6  #: out of 1; below it, one word is not a typo of the other
_MAX_WORD = 64  #: the longest word that is compared with others
_MAX_PATH = 4096  #: bytes, Linux' PATH_MAX


class UnfitError(ValueError):
    """The text does not fit its key; the message says what would."""


def is_null(node: object) -> bool:
    """Whether the value was written as `null`."""
    return isinstance(node, Scalar) and node.plain and _NULL.fullmatch(node.text) is not None


def nearest(word: str, known: Iterable[str]) -> str:
    """The known word that was probably meant, or ""."""
    if len(word) > _MAX_WORD:
        return ""
    folded = word.casefold().replace("-", "_")
    score = {other: SequenceMatcher(None, folded, other.casefold().replace("-", "_")).ratio() for other in known}
    best = max(score, key=score.__getitem__, default="")
    return best if best and score[best] >= _ALIKE else ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`did you mean X?` if a known word is close, followed by all allowed words."""
    known = tuple(known)
    near = nearest(word, known)
    return (f"did you mean {near}? Allowed: " if near else "allowed: ") + ", ".join(known)


def quantity(value: float, unit: str) -> str:
    """A number with its unit, without a trailing `.0`."""
    return f"{value:.10g}" + (f" {unit}" if unit else "")


def allowed(key: KeyRule) -> str:
    """The bounds of a key in words, e.g. "above 0, at most 100 %"."""
    if key.ge is not None and key.le is not None:
        return f"{key.ge:g} … {key.le:g} {key.unit}".rstrip()
    lower = f"at least {key.ge:g}" if key.ge is not None else f"above {key.gt:g}" if key.gt is not None else ""
    upper = f"at most {key.le:g}" if key.le is not None else f"below {key.lt:g}" if key.lt is not None else ""
    bounds = ", ".join(part for part in (lower, upper) if part)
    return f"{bounds} {key.unit}".rstrip() if bounds else ""


def bounded(value: float, key: KeyRule) -> float:
    """`value` itself, if it lies within the key's bounds."""
    low = (key.ge is not None and value < key.ge) or (key.gt is not None and value <= key.gt)
    high = (key.le is not None and value > key.le) or (key.lt is not None and value >= key.lt)
    if low or high:
        raise UnfitError(f"{quantity(value, key.unit)} is too {'low' if low else 'high'}, allowed: {allowed(key)}")
    return value


def read_float(node: Scalar, key: KeyRule) -> float:
    """A decimal number without exponent."""
    if node.plain and len(node.text) <= MAX_DIGITS and NUMBER.fullmatch(node.text):
        return bounded(float(node.text), key)
    raise UnfitError(why_no_number(node, key))


def read_int(node: Scalar, key: KeyRule) -> int:
    """A whole number, decimal or 0x… hexadecimal."""
    if node.plain and len(node.text) <= MAX_DIGITS:
        if HEX.fullmatch(node.text):
            return int(bounded(int(node.text, 16), key))
        if (match := NUMBER.fullmatch(node.text)) and not match[2]:
            return int(bounded(int(node.text), key))
        if match:
            raise UnfitError(f"{node.text} must be a whole number, e.g. {round(float(node.text))}")
    raise UnfitError(why_no_number(node, key, whole=True))


def read_bool(node: Scalar, _key: KeyRule) -> bool:
    """`true` or `false`."""
    if node.plain and node.text in ("true", "false"):
        return node.text == "true"
    word = node.text.strip().casefold()
    meant = "true" if word in _TRUE else "false" if word in _FALSE else "true or false"
    raise UnfitError(f"write {meant}{'' if node.plain else ' without quotes'}, not {shown(node.text)}")


def read_str(node: Scalar, key: KeyRule) -> str:
    """One non-empty line of text."""
    if not node.text.strip():
        raise UnfitError(f"needs a text: {key.about}")
    if not node.text.isprintable():
        raise UnfitError("needs one line of text without control characters")
    return node.text


def read_path(node: Scalar, key: KeyRule) -> str:
    """A path; a bare name is refused for a device."""
    text = read_str(node, key)
    if len(text) > _MAX_PATH:
        raise UnfitError(f"a path has at most {_MAX_PATH} characters, this one {len(text)}")
    if key.is_path and _URL.match(text):
        raise UnfitError(
            f"{shown(text)} is a URL; write a device below /dev: only a port of this machine can be locked, have its "
            "settings checked, and be told to stop when all else hangs"
        )
    if key.is_path and text.startswith("dev/"):
        raise UnfitError(f"write /{text}: a path without the first / begins at this file's directory")
    if key.is_path and "/" not in text:
        known = text.startswith(("tty", "gpiochip")) and not text.startswith(("ttyUSB", "ttyACM"))
        example = f"/dev/{text}" if known else "/dev/serial/by-path/…"
        raise UnfitError(f"{shown(text)} is not a whole path: write e.g. {example[:MAX_DIGITS]}")
    return text


def read_enum(node: Scalar, kind: type[Enum]) -> Enum:
    """A member by its name in lower case."""
    members = {member.name.lower(): member for member in kind}
    if node.text in members:
        return members[node.text]
    if "off" in members and node.text.casefold() in _NOTHING:
        raise UnfitError(f"write off, not {shown(node.text)}; allowed: {', '.join(members)}")
    raise UnfitError(f"{shown(node.text)} is not one of the words allowed here; {did_you_mean(node.text, members)}")


def read_any(node: Scalar, key: KeyRule) -> object:
    """A value to be passed unchanged to a library: null, true/false, a number or a text."""
    if not node.plain:
        return read_str(node, key) if node.text else ""
    if is_null(node):
        return None
    if node.text in ("true", "false"):
        return node.text == "true"
    if HEX.fullmatch(node.text) or ((match := NUMBER.fullmatch(node.text)) and not match[2]):
        return read_int(node, key)
    if NUMBER.fullmatch(node.text):
        return float(node.text)
    if node.text.casefold() in _TRUE | _FALSE:
        raise UnfitError(f'{node.text} is ambiguous: write true or false, or "{node.text}" in quotes for the text')
    if _AMBIGUOUS.fullmatch(node.text):
        raise UnfitError(f"{why_no_number(node, key)}; or in quotes for the text")
    return node.text


_AMBIGUOUS = re.compile(r"[-+]?(0\d+|0o\d+|0b[01]+|\d[\d_]*_\d*|\d+\.|\.\d+|\d+(\.\d*)?e[-+]?\d+|\.(nan|inf))", re.I)
