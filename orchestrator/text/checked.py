"""The last line of `check`: what it looked at, and how much it found."""

from collections.abc import Callable, Mapping

#: What is counted, in this order → one and many of it.
THINGS = {
    "bay": ("bay", "bays"),
    "policy": ("policy", "policies"),
    "map": ("object map", "object maps"),
    "scenario": ("scenario", "scenarios"),
    "northbound": ("northbound file", "northbound files"),
    "file": ("file", "files"),  # where nothing in it could be counted
    "error": ("error", "errors"),
    "warning": ("warning", "warnings"),
}
#: The same in Korean, with the counter of each; a noun has no plural.
THINGS_KO = {
    "bay": ("베이", "개"),
    "policy": ("정책", "개"),
    "map": ("객체 맵", "개"),
    "scenario": ("시나리오", "개"),
    "northbound": ("상위 연계 파일", "개"),
    "file": ("파일", "개"),
    "error": ("오류", "건"),
    "warning": ("경고", "건"),
}


def summary(looked_at: Mapping[str, int], errors: int, warnings: int, language: str = "en") -> str:
    """`2 bays, 1 policy: no errors, 1 warning`. An unknown language means English.

    A file with errors has not been searched for warnings, so their absence is not claimed beside errors.
    """
    count = _COUNTS.get(language, _english)
    what = ", ".join(count(thing, looked_at[thing]) for thing in THINGS if looked_at.get(thing))
    found = [count("error", errors), *([count("warning", warnings)] if warnings or not errors else [])]
    return f"{what}: {', '.join(found)}"


def _english(thing: str, number: int) -> str:
    one, many = THINGS[thing]
    return f"{number or 'no'} {one if number == 1 else many}"


def _korean(thing: str, number: int) -> str:
    noun, counter = THINGS_KO[thing]
    return f"{noun} {number}{counter}" if number else f"{noun} 없음"


_COUNTS: Mapping[str, Callable[[str, int], str]] = {"en": _english, "ko": _korean}
