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
#: The end of a name, also of a month that is over: that is compressed.
PLAIN, PACKED = ".jsonl", ".jsonl.gz"
_NAME = re.compile(r"(\d{4}-(0[1-9]|1[0-2]))\.jsonl(\.gz)?")


def files(names: Iterable[str]) -> list[str]:
    """The files of records among these names, by their month."""
    return sorted(name for name in names if _NAME.fullmatch(name))


def current(unix_s: float, names: Iterable[str]) -> str:
    """The file for a record that is written now."""
    known = _months(names)
    last = known[-1] if known else "1970-01"
    if unix_s < NEVER_SET_S and known:
        return f"{last}{PLAIN}"
    name = f"{month(unix_s)}{PLAIN}"
    return name if _NAME.fullmatch(name) else f"{last}{PLAIN}"


def newest(unix_s: float, names: Iterable[str]) -> list[str]:
    """The files in which an open charge and the newest one are: paused ones are recorded every day.

    If the clock has gone back, what was written last may be in any file.
    """
    known, found = _months(names), files(names)
    if known and known[-1] > current(unix_s, found)[:7]:
        return found
    return [name for name in found if name[:7] in known[-2:]]


def finished(names: Iterable[str]) -> list[str]:
    """The files to be compressed: nothing is likely to be added to their months."""
    found = files(names)
    over = _months(found)[:-2]
    return [name for name in found if name.endswith(PLAIN) and name[:7] in over and f"{name}.gz" not in found]


def outdated(unix_s: float, names: Iterable[str], years: float) -> list[str]:
    """The files that have been kept long enough."""
    known, found = _months(names), files(names)
    if len(known) < 2 or unix_s < NEVER_SET_S:
        return []
    now = min(_number(current(unix_s, found)), _number(known[-2]) + 1)
    return [name for name in found if now - _number(name) > years * 12]


def _months(names: Iterable[str]) -> list[str]:
    return sorted({name[:7] for name in names if _NAME.fullmatch(name)})


def _number(name: str) -> int:
    """Its month, counted from the year 0."""
    return int(name[:4]) * 12 + int(name[5:7])
