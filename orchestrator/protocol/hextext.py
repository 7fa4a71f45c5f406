"""Bytes as text, and hexadecimal as people paste it: `AF FA 90`, `AFFA90`, `0xAF,0xFA`, `[AF:FA]`, `\\xAF\\xFA`."""

import re

from orchestrator.errors import HexError

_PREFIX = re.compile(r"0x|\\x", re.IGNORECASE)
_DIGITS = re.compile(r"[0-9A-Fa-f]+")
_STRANGE = re.compile(r"[^0-9A-Fa-f\s,;:|\-\[\](){}<>]+")


def hex_of(data: bytes | bytearray) -> str:
    """How this package prints bytes: `AF FA 90`."""
    return data.hex(" ").upper()


def byte_count(count: int) -> str:
    """`1 byte`, `2 bytes`."""
    return f"{count} byte" if count == 1 else f"{count} bytes"


def parse_hex(text: str) -> bytes:
    """The bytes in a text. HexError names every character that is not hexadecimal, by position from 1."""
    spaced = _PREFIX.sub("  ", text)  # as long as the prefix, to keep positions correct
    strange = [f"{found[0]!r} at character {found.start() + 1}" for found in _STRANGE.finditer(spaced)]
    if strange:
        raise HexError(f"not hexadecimal: {', '.join(strange)}")
    groups = list(_DIGITS.finditer(spaced))
    # A lone digit is a byte printed without its zero; a longer odd group lost a digit at an unknown place.
    odd = [f"{found[0]!r} at character {found.start() + 1}" for found in groups if len(found[0]) % 2 and found[0][1:]]
    if odd:
        raise HexError(f"an odd number of digits: {', '.join(odd)}; a byte has two")
    if not groups:
        raise HexError("no bytes given; write them as AF FA 90 …")
    return b"".join(bytes.fromhex(found[0].zfill(2)) for found in groups)
