"""The names of the files that the records are in, one for each month, and how long they stay. Pure.

The clock may be wrong: one that was never set does not begin a file of 1970, and one that has jumped ahead removes
nothing, unless it stays there for more than a month.
"""

import re
from collections.abc import Iterable

from orchestrator.record.stamp import NEVER_SET_S
from orchestrator.record.utc import month

#: The folder of the records, in the journal's.
FOLDER = "sessions"
_NAME = re.compile(r"(\d{4})-(0[1-9]|1[0-2])\.jsonl")


def files(names: Iterable[str]) -> list[str]:
    """The files of records among these names, by their month."""
    return sorted(name for name in names if _NAME.fullmatch(name))


def current(unix_s: float, names: Iterable[str]) -> str:
    """The file for a record that is written now."""
    known = files(names)
    if unix_s < NEVER_SET_S and known:
        return known[-1]
    name = f"{month(unix_s)}.jsonl"
    return name if _NAME.fullmatch(name) else known[-1] if known else "1970-01.jsonl"


def newest(unix_s: float, names: Iterable[str]) -> list[str]:
    """The files in which an open charge and the newest one are: paused ones are recorded every day.

    If the clock has gone back, what was written last may be in any file.
    """
    known = files(names)
    return known if known and known[-1] > current(unix_s, known) else known[-2:]


def outdated(unix_s: float, names: Iterable[str], years: float) -> list[str]:
    """The files that have been kept long enough."""
    known = files(names)
    if len(known) < 2 or unix_s < NEVER_SET_S:
        return []
    now = min(_number(current(unix_s, known)), _number(known[-2]) + 1)
    return [name for name in known if now - _number(name) > years * 12]


def _number(name: str) -> int:
    """Its month, counted from the year 0."""
    return int(name[:4]) * 12 + int(name[5:7])
