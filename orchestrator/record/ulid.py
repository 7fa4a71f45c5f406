"""ULIDs: 26 letters, 48 bits of time and 80 of chance, which sort by age. Pure.

A clock may step back, and two charges may begin in one millisecond. Each id is therefore made after the one before:
its time is never earlier than that one's, so the ids of a station are in the order in which its charges began. The time
in an id is no evidence of when that was; the record has it.
"""

LETTERS = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
LENGTH, TIME = 26, 10
#: The bytes of chance that an id needs.
CHANCE = 10
#: The latest time that fits, in milliseconds.
MOST_MS = (1 << 48) - 1


def after(last: str, unix_s: float, chance: bytes) -> str:
    """An id that sorts behind `last` ("" for none); `chance` has `CHANCE` random bytes."""
    before_ms = _number(last[:TIME]) if is_ulid(last) else -1
    time_ms = min(max(int(unix_s * 1000), before_ms + 1, 0), MOST_MS)
    return _letters(time_ms, TIME) + _letters(int.from_bytes(chance[:CHANCE], "big"), LENGTH - TIME)


def is_ulid(text: object) -> bool:
    """Whether it is one."""
    return isinstance(text, str) and len(text) == LENGTH and set(text) <= set(LETTERS) and text[0] <= "7"


def _number(letters: str) -> int:
    number = 0
    for letter in letters:
        number = number * 32 + LETTERS.index(letter)
    return number


def _letters(number: int, count: int) -> str:
    return "".join(LETTERS[number >> 5 * place & 31] for place in reversed(range(count)))
