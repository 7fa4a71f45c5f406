"""Chooses Korean particles, written as 을(를) in the templates, by the last sound of what precedes them.

That is only known once the parameters are in place: numbers are read in Sino-Korean, units by their name, and names of
capitals letter by letter. Where the sound of a foreign word is not clear, both forms stay.
"""

import re
from enum import Enum


class Sound(Enum):
    """How a word ends."""

    VOWEL = 0
    RIEUL = 1  #: 로 follows it as it does a vowel
    CONSONANT = 2


V, L, C = Sound
#: The pairs: after a consonant, after a vowel.
PAIRS = {"을(를)": ("을", "를"), "이(가)": ("이", "가"), "은(는)": ("은", "는"), "(으)로": ("으로", "로")}
#: 영 일 이 삼 사 오 육 칠 팔 구
DIGITS = dict(zip("0123456789", (C, L, V, C, V, V, C, L, L, V), strict=True))
#: Units by their names: 퍼센트, 도, 볼트, 암페어, 암페어시, 와트시, 케이, 보.
UNITS = {"%": V, "°C": V, "V": V, "A": V, "Ah": V, "Wh": V, "K": V, "baud": V}
#: The names of letters that end in a consonant: 엘, 엠, 엔, 알.
LETTERS = {"L": L, "M": C, "N": C, "R": L}
#: How foreign words end whose last letter is clear.
ENDINGS = {"l": L, "m": C, "n": C, **dict.fromkeys("adefhijorsuvwxyz", V)}
TWO_LETTERS = {"le": L, "me": C, "ne": C, "ck": C, "ng": C}
PAIR = re.compile("|".join(map(re.escape, PAIRS)))
CLOSED = re.compile(r"\([^()]*\)$|[\"'`)\]]+$")
#: No name with what is in brackets behind it is longer.
FAR = 200
FIRST, LAST, ENDS, RIEUL = ord("가"), ord("힣"), 28, 8


def resolved(text: str) -> str:
    """The text with every particle chosen that can be."""
    return PAIR.sub(_chosen, text)


def _chosen(found: re.Match[str]) -> str:
    pair, start = found.group(), found.start()
    sound = _sound(found.string[max(start - FAR, 0) : start])
    if sound is None:
        return pair
    closed, vowel = PAIRS[pair]
    return vowel if sound is V or (sound is L and pair == "(으)로") else closed


def _sound(before: str) -> Sound | None:
    """How the last word ends, without what is in brackets behind it; None if that is not clear."""
    while (bare := CLOSED.sub("", before)) != before:
        before = bare
    if not before or before[-1].isspace():
        return None
    word = before.split()[-1]
    last = word[-1]
    if FIRST <= ord(last) <= LAST:
        end = (ord(last) - FIRST) % ENDS
        return V if end == 0 else L if end == RIEUL else C
    if last in DIGITS:
        return DIGITS[last]
    unit = re.search(r"[^\d.,+\-]*$", word)
    if unit and unit.group() in UNITS:
        return UNITS[unit.group()]
    if last.isupper():
        return LETTERS.get(last, V)
    return TWO_LETTERS.get(word[-2:], ENDINGS.get(last))
